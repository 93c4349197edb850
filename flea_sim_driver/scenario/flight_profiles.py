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

"""Commands of control surfaces in flight, as tables of public shapes.

Levels are shares of the stroke about the middle, loads shares of the load limit, so every machine
can fly them within its own limits. Turbulence is drawn by the seed of the run.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.errors import ConfigurationError, shown
from flea_sim_driver.machine.machine import Limits
from flea_sim_driver.scenario.flight import Flight
from flea_sim_driver.scenario.live_command import lag

Array = npt.NDArray[np.float64]
Shape = Callable[[Array, np.random.Generator], Array]
DURATION_S = 60.0
ROW_S = 0.02
"""Rows of a profile, at the 50 Hz of an aircraft's data bus."""
ROOM = 0.99
"""Share of its limits that a machine is flown to."""
SWELL_S = 1.0
"""Time in which a profile rises from rest."""
SERVO_RAD_S = 6.0
"""Bandwidth of a pilot, or of the flight control, that answers to a gust."""


def _ramp(u: Array) -> Array:
    """From 0 to 1 without a jump in speed or acceleration."""
    u = np.clip(u, 0.0, 1.0)
    return u**3 * (10.0 - 15.0 * u + 6.0 * u**2)


def _steps(*levels: tuple[float, float], rise_s: float, every_s: float = 0.0) -> Shape:
    """Levels from times in s on, each reached in ``rise_s``, anew every so often."""

    def shape(time_s: Array, _draw: np.random.Generator) -> Array:
        within = np.mod(time_s, every_s) if every_s else time_s
        path, before = np.zeros_like(time_s), 0.0
        for at_s, level in levels:
            path += (level - before) * _ramp((within - at_s) / rise_s)
            before = level
        return path

    return shape


def _sine(level: float, frequency_hz: float) -> Shape:
    def shape(time_s: Array, _draw: np.random.Generator) -> Array:
        return np.asarray(level * np.sin(2.0 * np.pi * frequency_hz * time_s))

    return shape


def _sweep(level: float, low_hz: float, high_hz: float, length_s: float) -> Shape:
    """An exponential sweep, as flown for frequency responses."""

    def shape(time_s: Array, _draw: np.random.Generator) -> Array:
        growth = np.log(high_hz / low_hz) / length_s
        within = np.mod(time_s, length_s)
        phase = 2.0 * np.pi * low_hz * np.expm1(growth * within) / growth
        swell = _ramp(within / SWELL_S) * _ramp((length_s - within) / SWELL_S)
        return np.asarray(level * swell * np.sin(phase))

    return shape


def _gust(rms: float, scale_s: float, *, vertical: bool = True) -> Shape:
    """Dryden turbulence (MIL-F-8785C, 3.7.2.2), scale length over speed in s, behind the servo."""

    def shape(time_s: Array, draw: np.random.Generator) -> Array:
        from scipy.signal import lfilter  # a second to import, and few stands fly

        pole = np.exp(-ROW_S / scale_s)
        forming = ([1.0], [1.0, -pole])
        if vertical:  # (1 + sqrt(3) L s / V) / (1 + L s / V)^2
            zero = np.exp(-ROW_S / (np.sqrt(3.0) * scale_s))
            forming = ([1.0, -zero], [1.0, -2.0 * pole, pole**2])
        path = np.concatenate(([1.0], np.zeros(round(20.0 * scale_s / ROW_S))))
        noise = draw.standard_normal(len(time_s))
        for top, bottom in (forming, lag(SERVO_RAD_S, ROW_S)):
            path, noise = lfilter(top, bottom, path), lfilter(top, bottom, noise)
        return np.asarray(rms * noise / np.sqrt(np.sum(path**2)))

    return shape


@dataclass(frozen=True)
class FlightProfile:
    """One surface in one manoeuvre.

    Parameters
    ----------
    shape
        In words, with amplitude and time.
    source
        Public document that has the manoeuvre or its spectrum.
    parts
        Add up to the deflection, in shares of the stroke.
    load, hinge
        Constant load, and load per deflection of a tenth of the stroke, shares of the limit.

    Less than a twentieth of the stroke does not move the FLEA: its soft loop needs an error of 3 mm
    to overcome friction.
    """

    name: str
    shape: str
    source: str
    parts: tuple[Shape, ...]
    load: float = 0.0
    hinge: float = 0.1

    def flight(self, limits: Limits, seed: int, duration_s: float = DURATION_S) -> Flight:
        """Position and load within the limits of a machine: smaller where it is too slow."""
        time_s = ROW_S * np.arange(round(duration_s / ROW_S) + 1)
        draw = np.random.default_rng((seed, *self.name.encode()))
        swell = _ramp(time_s / SWELL_S)
        deflection = swell * sum(part(time_s, draw) for part in self.parts)
        load = self.load * swell + self.hinge * deflection / 0.1
        load_n = limits.load_n * np.clip(load, -1.0, 1.0)
        whole = Flight(time_s, limits.stroke_m * (0.5 + deflection), load_n)
        share = ROOM * min(
            limits.flight_speed_m_s / _largest(np.diff(whole.position_m) / ROW_S),
            limits.flight_acceleration_m_s2 / _largest(whole.acceleration_m_s2()),
            0.5 / _largest(deflection),
        )
        smaller = limits.stroke_m * (0.5 + min(share, 1.0) * deflection)
        return Flight(time_s, smaller, load_n)


MIL, ADS = "MIL-HDBK-1797", "ADS-33E-PRF"
DRYDEN = "Dryden spectrum, MIL-F-8785C 3.7.2"
TISCHLER = "Tischler and Remple, Aircraft and Rotorcraft System Identification"
DOUBLET = ((1.0, 1.0), (2.0, -1.0), (3.0, 0.0))
CODE_3211 = ((1.0, 1.0), (3.1, -1.0), (4.5, 1.0), (5.2, -1.0), (5.9, 0.0))


def _largest(values: Array) -> float:
    return max(float(np.abs(values).max()), 1e-9)


def _scaled(level: float, rows: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
    return tuple((at_s, level * share) for at_s, share in rows)


FLIGHT_PROFILES: tuple[FlightProfile, ...] = (
    FlightProfile("aileron_doublet", "doublet of 12 %, 1 s a side, every 12 s",
                  f"{MIL}, roll response to a doublet",
                  (_steps(*_scaled(0.12, DOUBLET), rise_s=0.4, every_s=12.0),)),
    FlightProfile("aileron_bank_to_bank", "20 % for 1.5 s each way between 30 degrees of bank",
                  "MIL-F-8785C 3.3.4, time to change bank",
                  (_steps((1.0, 0.2), (2.5, 0.0), (6.0, -0.2), (9.0, 0.0), (12.5, 0.2),
                          (14.0, 0.0), rise_s=0.7, every_s=16.0),)),
    FlightProfile("aileron_trim", "trim steps of 5 %, holds of 9 s", f"{MIL}, trim in cruise",
                  (_steps((1.0, 0.05), (10.0, 0.1), (19.0, 0.05), (28.0, 0.0), rise_s=1.0,
                          every_s=37.0),), load=0.2),
    FlightProfile("aileron_gust_light", "gusts of 4 % rms, 2 s", f"{DRYDEN}, light, roll",
                  (_gust(0.04, 2.0, vertical=False),)),
    FlightProfile("aileron_gust_severe", "gusts of 8 % rms, 1 s", f"{DRYDEN}, severe, roll",
                  (_gust(0.08, 1.0, vertical=False),)),
    FlightProfile("elevator_3211", "3-2-1-1 of 12 %, 0.7 s a unit, every 14 s",
                  "Marchand and Koehler 1974; Jategaonkar, Flight Vehicle System Identification",
                  (_steps(*_scaled(0.12, CODE_3211), rise_s=0.4, every_s=14.0),)),
    FlightProfile("elevator_pulse", "pulse of 15 % for 1 s, every 10 s",
                  f"{MIL}, short-period response",
                  (_steps((1.0, 0.15), (2.0, 0.0), rise_s=0.5, every_s=10.0),)),
    FlightProfile("elevator_phugoid", "8 % at 0.05 Hz, gusts of 1 % rms",
                  f"{MIL}, phugoid held by altitude hold", (_sine(0.08, 0.05), _gust(0.01, 4.4))),
    FlightProfile("elevator_gust", "gusts of 6 % rms, 4.4 s", f"{DRYDEN}, moderate, vertical",
                  (_gust(0.06, 4.4),)),
    FlightProfile("elevator_flare", "corrections of 4 % rms, flare of 20 % in 5 s",
                  "FAA AC 120-28D, approach and flare",
                  (_gust(0.04, 1.5), _steps((28.0, 0.2), (38.0, 0.02), rise_s=5.0)), load=0.1),
    FlightProfile("elevator_sweep", "8 % from 0.05 to 0.6 Hz in 60 s", f"{TISCHLER}, 5.2",
                  (_sweep(0.08, 0.05, 0.6, 60.0),)),
    FlightProfile("rudder_doublet", "doublet of 15 %, 2 s a side, every 15 s",
                  f"{MIL}, Dutch roll",
                  (_steps((1.0, 0.15), (3.0, -0.15), (5.0, 0.0), rise_s=0.7, every_s=15.0),)),
    FlightProfile("rudder_engine_failure", "step of 20 % in 0.7 s, held, eased off in 8 s",
                  "14 CFR 25.149, minimum control speed",
                  (_steps((10.0, 0.2), rise_s=0.7), _steps((25.0, -0.2), rise_s=8.0),
                   _gust(0.03, 2.0)), hinge=0.2),
    FlightProfile("spoiler_deployment", "40 % in 1 s, held for 14 s, back in 2 s, twice a minute",
                  "14 CFR 25.697, lift and drag devices",
                  (_steps((2.0, 0.4), rise_s=1.0, every_s=30.0),
                   _steps((17.0, -0.4), rise_s=2.0, every_s=30.0)), hinge=0.1),
    FlightProfile("stabiliser_trim", "ramps of 8 % in 4 s, holds of 8 s",
                  f"{MIL}, trim changes with speed",
                  (_steps((1.0, 0.08), (13.0, 0.16), (25.0, 0.08), (37.0, 0.0), rise_s=4.0,
                          every_s=49.0),), load=0.3),
    FlightProfile("collective_bob_up", "20 % up, held for 4 s, down, every 16 s",
                  f"{ADS}, vertical manoeuvre",
                  (_steps((1.0, 0.2), (2.5, -0.1), (4.0, 0.0), (8.0, -0.16), (9.5, 0.1),
                          (11.0, 0.0), rise_s=1.0, every_s=16.0),), load=0.1),
    FlightProfile("cyclic_hover", "corrections of 6 % rms, 1 s", f"{ADS}, hover",
                  (_gust(0.06, 1.0),)),
    FlightProfile("cyclic_pirouette", "6 % in 45 s a turn, corrections of 4 % rms",
                  f"{ADS}, pirouette", (_sine(0.06, 1.0 / 45.0), _gust(0.04, 1.2))),
    FlightProfile("cyclic_slalom", "15 % each way in 8 s, corrections of 2 % rms",
                  f"{ADS}, slalom", (_sine(0.15, 0.125), _gust(0.02, 1.2))),
    FlightProfile("pedal_hovering_turn", "turn of 18 % in and out in 10 s, every 20 s",
                  f"{ADS}, hovering turn",
                  (_steps((1.0, 0.18), (3.0, 0.0), (8.0, -0.18), (10.0, 0.0), rise_s=1.5,
                          every_s=20.0), _gust(0.02, 1.2))),
)  # fmt: skip
_BY_NAME = {row.name: row for row in FLIGHT_PROFILES}


def is_profile(name: str) -> bool:
    """Whether a row has this name."""
    return name in _BY_NAME


def find_profile(name: str) -> FlightProfile:
    """One row by its name.

    Raises
    ------
    ConfigurationError
        No row has it.
    """
    if name not in _BY_NAME:
        raise ConfigurationError(f"flight profile {shown(name)} is none of {', '.join(_BY_NAME)}")
    return _BY_NAME[name]
