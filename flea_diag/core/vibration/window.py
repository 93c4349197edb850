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

"""One window of the vibration stream, and the spectra that features share."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, wraps
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from flea_diag.errors import InputError

Floats = npt.NDArray[np.floating]
Result = TypeVar("Result")


class NotComputableError(InputError):
    """A feature has no value on this window; the message is the reason."""


@dataclass(frozen=True, eq=False)
class Window:
    """Acceleration of some axes, with the simultaneous motion if it is known.

    Parameters
    ----------
    samples : (n, axes) float32 or float64, m/s^2
    rate_hz : sampling rate of ``samples``
    axes : names of the columns, ``accelerometer_1_x`` and so on
    speed_rad_s : (n,) shaft speed at each sample, or None where it is not measured
    slow : channel name to (scans,) values in SI units, with ``slow_time_s`` (scans,) counted
        from the first sample
    orders : name of a ball-pass line to its order (events per shaft revolution)
    start_s : time of the first sample, after the requested start of the window

    Spectra are computed once and shared by all features of the same window (`shared`).
    """

    samples: Floats
    rate_hz: float
    axes: tuple[str, ...]
    speed_rad_s: Floats | None = None
    slow: Mapping[str, Floats] = field(default_factory=dict)
    slow_time_s: Floats = field(default_factory=lambda: np.empty(0))
    orders: Mapping[str, float] = field(default_factory=dict)
    start_s: float = 0.0
    results: dict[Any, Any] = field(default_factory=dict, init=False, repr=False)

    @property
    def count(self) -> int:
        """Number of points."""
        return len(self.samples)

    @property
    def duration_s(self) -> float:
        """Length of the window."""
        return self.count / self.rate_hz

    @cached_property
    def is_finite(self) -> bool:
        """Whether every sample is a number."""
        return bool(np.isfinite(self.samples).all())

    @cached_property
    def centred(self) -> npt.NDArray[np.float32]:
        """Samples without their mean, one contiguous row an axis, shape (axes, n)."""
        rows = np.ascontiguousarray(self.samples.T, dtype=np.float32)
        return np.asarray(rows - rows.mean(axis=1, keepdims=True))

    @cached_property
    def std(self) -> Floats:
        """Standard deviation of each axis, shape (axes,)."""
        return np.asarray(np.sqrt(np.einsum("an,an->a", self.centred, self.centred) / self.count))

    @cached_property
    def spectrum(self) -> npt.NDArray[np.complexfloating]:
        """Real FFT of the centred rows, shape (axes, n // 2 + 1); the one shared FFT."""
        from scipy import fft

        return np.asarray(fft.rfft(self.centred, axis=1))

    @cached_property
    def power(self) -> Floats:
        """Mean square of each bin of ``spectrum``; rows sum to the variance (Parseval)."""
        power = (self.spectrum.real**2 + self.spectrum.imag**2) * (2.0 / self.count**2)
        power[:, 0] *= 0.5
        if self.count % 2 == 0:
            power[:, -1] *= 0.5
        return np.asarray(power)

    @cached_property
    def shaft_angle_rad(self) -> Floats:
        """Shaft angle at each sample, from 0, shape (n,)."""
        return np.asarray(np.cumsum(self.speed) / self.rate_hz)

    @property
    def speed(self) -> Floats:
        """Shaft speed, or a refusal where it is not measured."""
        if self.speed_rad_s is None or not np.isfinite(self.speed_rad_s).all():
            raise NotComputableError("motor_speed is not measured throughout the window")
        return self.speed_rad_s

    def channel(self, name: str) -> Floats:
        """One slow channel over the window, or a refusal where it is not measured."""
        values = self.slow.get(name)
        if values is None or len(values) < 2 or not np.isfinite(values).all():
            raise NotComputableError(f"{name} is not measured throughout the window")
        return values

    def order(self, line: str) -> float:
        """Order of a ball-pass line, or a refusal where the kinematics do not give it."""
        if line not in self.orders:
            raise NotComputableError("the kinematics of the stand do not give this line")
        return self.orders[line]

    def band(self, low_hz: float, high_hz: float) -> slice:
        """Bins of ``spectrum`` inside a band; refused where the rate cannot carry the band."""
        if high_hz > self.rate_hz / 2 or low_hz >= high_hz:
            raise NotComputableError(
                f"band {low_hz:g} to {high_hz:g} Hz goes beyond half the rate {self.rate_hz:g} Hz"
            )
        return slice(
            int(np.ceil(low_hz * self.duration_s)), int(np.ceil(high_hz * self.duration_s))
        )

    def of(self, accelerometer: str) -> Window:
        """Window of the axes of one accelerometer (``accelerometer_1``), or a refusal."""
        columns = [k for k, axis in enumerate(self.axes) if axis.startswith(accelerometer + "_")]
        if not columns:
            raise NotComputableError(f"no axis of {accelerometer} among {', '.join(self.axes)}")
        if len(columns) == len(self.axes):
            return self
        return replace(
            self,
            samples=self.samples[:, columns],
            axes=tuple(self.axes[k] for k in columns),
        )

    def moved(
        self, speed_rad_s: Floats | None, slow: Mapping[str, Floats], slow_time_s: Floats
    ) -> Window:
        """The same samples with their motion; results computed from them are kept."""
        found = replace(self, speed_rad_s=speed_rad_s, slow=slow, slow_time_s=slow_time_s)
        found.results.update(self.results)
        found.__dict__.update(self.__dict__ | found.__dict__)  # cached properties
        return found

    @property
    def accelerometers(self) -> tuple[str, ...]:
        """Names of the accelerometers whose axes are here, in order."""
        return tuple(dict.fromkeys(axis.rsplit("_", 1)[0] for axis in self.axes))


def shared(function: Callable[[Window], Result]) -> Callable[[Window], Result]:
    """Compute ``function`` once per window, for all features that use it."""

    @wraps(function)
    def once(window: Window) -> Result:
        if function not in window.results:
            window.results[function] = function(window)
        result: Result = window.results[function]
        return result

    return once
