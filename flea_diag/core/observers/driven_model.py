# Copyright 2026 flea_diag maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The driven model of one actuator: compiled equations with calibrated numbers, as filters run it.

What is linear and what is friction comes from the bond graph (``driven_equations``), how it moves
in a scan from ``motion_step``. The current follows voltage and speed at once, for L / R is far
below a scan.

Where the voltage is raw PWM (one instant of +24, 0 or -24 V), a sample says little of the
mean voltage, which is what moves the motor. It is then no input but a very noisy measurement
of a slowly wandering mean, and the current says the rest.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from flea_diag.core import backend as backends
from flea_diag.core.frozen import Frozen
from flea_diag.core.observers.motion_step import (
    MotionCoefficients,
    motion_step,
    moved,
    put,
    put_loops,
)
from flea_diag.core.observers.observer_noise import ObserverNoise
from flea_diag.core.observers.resampling_loops import exp_loops
from flea_diag.core.observers.track_loops import TANH, TRACK, track_loops
from flea_diag.core.residuals.driven_equations import DrivenEquations, numbers
from flea_diag.core.residuals.parameters import ActuatorParameters, as_record

Array = npt.NDArray[np.float64]

STATES = (
    "voltage_v",
    "mean_speed_m_s",
    "speed_m_s",
    "position_m",
)

WALK = 1.0 / 60.0
"""Of a position's noise that it wanders in a scan: a perfect integral of the speed would shut its
sensor out."""


@dataclass(frozen=True)
class DrivenModel(Frozen):
    """A ``FilterModel`` of an actuator with calibrated parameters."""

    equations: DrivenEquations
    parameters: ActuatorParameters
    period_s: float
    noise: ObserverNoise
    sigmas: tuple[float, ...]
    """Standard deviation of one reading of each channel; of the voltage as raw PWM."""
    walk: float
    """Standard deviation of what the position wanders in a scan."""
    pwm: bool
    """Voltage sampled as raw PWM, hence a measurement and no input."""
    winding_degc: float
    """Temperature at which the resistance is taken."""

    states = STATES
    linear = None

    @property
    def channels(self) -> tuple[str, ...]:
        """Readings of the motion."""
        return self.equations.channels.readings

    @property
    def inputs(self) -> tuple[str, str]:
        """Voltage and load."""
        return self.equations.channels.inputs

    def warmed(self, degc: float) -> DrivenModel:
        """The same at another winding temperature."""
        return replace(self, winding_degc=degc)

    @cached_property
    def driving(self) -> npt.NDArray[np.bool_]:
        """Raw PWM stands for the input that is missing."""
        return np.array([name == self.inputs[0] and self.pwm for name in self.channels])

    @cached_property
    def absent(self) -> npt.NDArray[np.bool_]:
        """Channels that are never measured: no relation gives them, or they are inputs."""
        given, voltage = self.equations.readings, self.inputs[0]
        return np.array([n not in given or (n == voltage and not self.pwm) for n in self.channels])

    @cached_property
    def _readings(self) -> Array:
        """By voltage, mean speed, position, and without them; shape (channels, 4)."""
        made = self.equations.functions["readings"]
        return np.array(numbers(made, self.parameters, self.winding_degc))

    @cached_property
    def H(self) -> Array:
        """Shape (channels, 4); zero in the row of a channel that no relation gives."""
        rows = np.zeros((len(self.channels), len(STATES)))
        rows[:, (0, 1, 3)] = self._readings[:, :3]
        return rows

    @cached_property
    def D(self) -> Array:
        """Inputs act through the states alone."""
        return np.zeros((len(self.channels), len(self.inputs)))

    @cached_property
    def h(self) -> Array:
        """Offsets of the readings, shape (channels,)."""
        offsets: Array = self._readings[:, 3]
        return offsets

    @cached_property
    def R(self) -> Array:
        """Diagonal, shape (channels, channels)."""
        return np.diag(np.array(self.sigmas) ** 2)

    @cached_property
    def _motion(self) -> tuple[list[float], list[float]]:
        """Coefficients of the acceleration, and of the voltage by the one commanded."""
        made = self.equations.functions["motion"]
        pushes, command = numbers(made, self.parameters, self.winding_degc)
        return pushes.tolist(), command.tolist()

    @property
    def _current(self) -> list[float]:
        """Coefficients of the current."""
        found: list[float] = self._readings[
            self.channels.index(self.equations.channels.current)
        ].tolist()
        return found

    @cached_property
    def coefficients(self) -> MotionCoefficients:
        """Of one scan."""
        volt, speed, _, rest = self._current
        current, speed_itself, load, alone = self._motion[0]
        pushes = current, speed_itself, load, alone
        return MotionCoefficients.of((volt, speed, rest), pushes, self.period_s)

    @cached_property
    def command(self) -> tuple[float, float]:
        """Offset and gain of the voltage by the one commanded; NaN where nothing relates them."""
        gain, offset = self._motion[1]
        return (offset, gain) if gain else (math.nan, math.nan)

    def voltage_v(self, current_a: float) -> float:
        """Voltage of a current at rest."""
        slope, _, _, rest = self._current
        return float((current_a - rest) / slope)

    def position_m(self, readings: Array) -> float:
        """Position by the first channel that reads it; NaN if none is measured."""
        slopes, rest = self._readings[:, 2], self.h
        found = [(readings[k] - rest[k]) / slopes[k] for k in np.flatnonzero(slopes)]
        return next((float(each) for each in found if not math.isnan(each)), math.nan)

    @cached_property
    def _noises(self) -> dict[tuple[bool, bool], Array]:
        """Process noise by whether voltage and load are measured."""
        noise, c = self.noise, self.coefficients
        pushed = np.array([0.0, c.averaged, c.gained, c.period_s * c.averaged])
        per_newton, per_volt = abs(c.pushes[2]) * pushed, c.per_volt * pushed
        per_volt[0] = 1.0
        own = np.diag([0.0, 0.0, 0.0, self.walk]) ** 2
        found = {}
        for voltage in (False, True):
            for load in (False, True):
                volt = noise.voltage_v if voltage else noise.voltage_walk_v
                newton = math.hypot(noise.force_n, 0.0 if load else noise.unmeasured_force_n)
                found[voltage, load] = (
                    own
                    + volt**2 * np.outer(per_volt, per_volt)
                    + newton**2 * np.outer(per_newton, per_newton)
                )
        return found

    def process_noise(self, u: Array) -> Array:
        """By which of voltage and load are measured."""
        return self._noises[not (self.pwm or math.isnan(u[0])), not math.isnan(u[1])]

    @cached_property
    def record(self) -> Any:
        """The parameters as compiled code takes them: the first entry of a sequence."""
        return as_record(self.parameters)

    def transition(self, x: Array, u: Array) -> Array:
        """(4, N) and (2,) -> (4, N); NaN inputs: voltage held, load in balance."""
        new = np.empty_like(x)
        step = step_of(self.equations)
        step(x, u, self.pwm, self.coefficients, (self.parameters,), new)
        return new

    def linearised(self, x: Array, u: Array) -> tuple[Array, Array]:
        """The transition of one state, and its derivatives by central differences."""
        return central_differences(self.transition, x, u)


def central_differences(
    transition: Callable[[Array, Array], Array], x: Array, u: Array
) -> tuple[Array, Array]:
    """A transition of one state and its partial derivatives: (n,) -> (n,), (n, n)."""
    n, steps = len(x), 1e-6 * np.maximum(1.0, np.abs(x))
    tried = np.repeat(x[:, None], 2 * n + 1, axis=1)
    tried[:, 1 : n + 1].flat[:: n + 1] += steps
    tried[:, n + 1 :].flat[:: n + 1] -= steps
    moved = transition(tried, u)
    slopes: Array = (moved[:, 1 : n + 1] - moved[:, n + 1 :]) / (2.0 * steps)
    return moved[:, 0], slopes


@lru_cache(maxsize=8)
def step_of(equations: DrivenEquations) -> Callable[..., None]:
    """``motion_step`` with the friction of these equations, in numpy."""
    return _bound_step(equations.functions["friction"], put)[0]


def _bound_step(friction: Callable[..., Any], put: Callable[..., Any]) -> list[Callable[..., Any]]:
    parts: dict[str, Any] = {"friction": friction, "put": put}
    parts["moved"] = backends.bound(moved, **parts)
    return [backends.bound(motion_step, **parts), parts["moved"], friction]


def step_parts(equations: DrivenEquations) -> tuple[Callable[..., Any], ...]:
    """``motion_step`` of these equations for numba, and what it calls."""
    friction = backends.bound(equations.functions["friction"], fabs=np.abs, **TANH)
    return (*_bound_step(friction, put_loops), *TANH.values(), exp_loops, put_loops)


def track_of(
    equations: DrivenEquations,
) -> tuple[Callable[..., Any], tuple[Callable[..., Any], ...]]:
    """``track_loops`` with the step of these equations for numba, and what it calls."""
    step = step_parts(equations)
    heats = backends.bound(equations.functions["supplies"], fabs=np.abs)
    return backends.bound(track_loops, motion_step=step[0], supplies=heats), (*step, *TRACK, heats)
