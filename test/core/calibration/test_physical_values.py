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

"""Parameters that no actuator has are refused by name, with their cause."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from flea_diag.core.calibration.calibration import NominalRun
from flea_diag.core.calibration.identified import Identified
from flea_diag.core.calibration.physical_values import check_physical
from flea_diag.core.residuals.parameters import ActuatorParameters
from flea_diag.errors import CalibrationError

CHANNELS = ("motor_current", "motor_voltage")
SWINGING = np.column_stack([np.sin(np.arange(200.0)), 9.0 * np.sin(np.arange(200.0))])
RECTIFIED = np.abs(SWINGING)


def found(value: float, without: float = 0.3) -> Identified:
    # As the fit leaves them: a parameter class does not check what is put into it later.
    known = SimpleNamespace(**dict.fromkeys(ActuatorParameters.__dataclass_fields__, 1.0))
    known.winding_resistance_ohm = value
    made = Identified(ActuatorParameters(), sigmas={"winding_resistance_ohm": 0.2})
    made.parameters = known  # type: ignore[assignment]
    made.without = [{"winding_resistance_ohm": 0.4}, {"winding_resistance_ohm": without}]
    return made


def test_a_motor_is_left_alone() -> None:
    check_physical(found(0.3), [NominalRun("a", SWINGING)], CHANNELS)


@pytest.mark.parametrize(
    ("parameters", "rows", "words"),
    [
        (found(-0.4), RECTIFIED, "winding resistance -0.4 ohm, must be above 0: the voltage never "
                                 "changes its sign with the speed.*leave motor_voltage out"),
        (found(-0.4), SWINGING, "motor_voltage does not follow the motion as its equation says"),
        (found(0.3, -0.1), SWINGING, "winding resistance -0.1 ohm without recording 2"),
        (found(float("nan")), SWINGING, "winding resistance nan ohm"),
    ],
)  # fmt: skip
def test_what_no_motor_has_is_refused_with_its_cause(
    parameters: Identified, rows: np.ndarray, words: str
) -> None:
    with pytest.raises(CalibrationError, match=words):
        check_physical(parameters, [NominalRun("a", rows)], CHANNELS)


def test_what_was_not_identified_is_not_held_against_a_recording() -> None:
    made = found(-0.4)
    made.sigmas.clear()
    check_physical(made, [NominalRun("a", SWINGING)], CHANNELS)
