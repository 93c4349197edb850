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

"""Identified parameters that no actuator has: refused before anything rests on them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from flea_diag.errors import CalibrationError

if TYPE_CHECKING:
    from flea_diag.core.calibration.calibration import NominalRun
    from flea_diag.core.calibration.identified import Identified

VOLTAGE = "motor_voltage"
SMALL, ONE_SIGN = 0.05, 0.01
"""Share of the largest reading that counts as zero, and of the readings that a voltage of one sign
may have of the other."""


class _Meaning(NamedTuple):
    """What a parameter is, and the channel that tells it."""

    words: str
    unit: str
    channel: str


POSITIVE: Mapping[str, _Meaning] = {
    "winding_resistance_ohm": _Meaning("winding resistance", "ohm", VOLTAGE),
    "back_emf_v_s_per_m": _Meaning("back-EMF", "V s/m", VOLTAGE),
    "force_constant_n_per_a": _Meaning("force constant", "N/A", "motor_current"),
    "reflected_mass_kg": _Meaning("moved mass", "kg", "motor_current"),
    "supply_voltage_v": _Meaning("supply voltage", "V", "motor_current"),
    "drive_gain": _Meaning("gain of the drive", "V/V", "commanded_voltage"),
    "motor_cooling_s": _Meaning("time of cooling of the motor", "s", "motor_temperature"),
    "nut_cooling_s": _Meaning("time of cooling of the nut", "s", "nut_temperature"),
}
"""Parameters that are above zero on every actuator."""


def check_physical(found: Identified, runs: Sequence[NominalRun], channels: Sequence[str]) -> None:
    """Refuse what no actuator has, by all recordings or by all but one.

    Parameters
    ----------
    found
        The parameters.
    runs, channels
        Recordings that they are of, and the channels of their columns.

    Raises
    ------
    CalibrationError
        Names the parameter, its value, the likely cause, and the channel to leave out.
    """
    for name, value, where in _impossible(found):
        meaning = POSITIVE[name]
        cause = _of_one_sign(runs, channels) if meaning.channel == VOLTAGE else ""
        raise CalibrationError(
            f"{meaning.words} {value:.3g} {meaning.unit}{where}, must be above 0: "
            f"{cause or f'{meaning.channel} does not follow the motion as its equation says'}; "
            f"leave {meaning.channel} out of channels.yaml, or record what it is to be"
        )


def _impossible(found: Identified) -> Iterator[tuple[str, float, str]]:
    """Parameter, value, and of which recordings."""
    known = [name for name in POSITIVE if name in found.sigmas]
    for name in known:
        value = float(getattr(found.parameters, name))
        if not value > 0.0:
            yield name, value, ""
    for number, values in enumerate(found.without, 1):
        for name in known:
            if not values.get(name, 1.0) > 0.0:
                yield name, float(values[name]), f" without recording {number}"


def _of_one_sign(runs: Sequence[NominalRun], channels: Sequence[str]) -> str:
    """Words on a voltage that has one sign although the motor is reversed."""
    if VOLTAGE not in channels:
        return ""
    column = list(channels).index(VOLTAGE)
    read = np.concatenate([run.rows[:, column] for run in runs])
    read = read[np.isfinite(read)]
    small = SMALL * float(np.abs(read).max(initial=0.0))
    shares = [float(np.mean(read < -small)), float(np.mean(read > small))]
    if len(read) and min(shares) < ONE_SIGN:
        return "the voltage never changes its sign with the speed, so it is no voltage of the motor"
    return ""
