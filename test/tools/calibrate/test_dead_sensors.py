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

"""A recording that is not nominal for one of its sensors is named with the reason."""

from __future__ import annotations

import numpy as np

from flea_diag.configuration.calibrations import load_calibration
from flea_diag.configuration.description import compiled_relations
from flea_diag.configuration.stand import load_stand
from flea_diag.core.calibration.calibration import NominalRun
from flea_diag.tools.calibrate.dead_sensors import dead_sensors

RELATIONS = compiled_relations("actuator.yaml")


def runs(missing: int) -> list[NominalRun]:
    """Eight of noise, 20 s each; the load cell of the third has no reading for so many scans."""
    draw, known = np.random.default_rng(5), RELATIONS.residuals
    found = [draw.standard_normal((2000, len(known.channels))) for _ in range(8)]
    found[2][500 : 500 + missing, known.index["load_force"]] = np.nan
    return [NominalRun(f"run{number}", rows) for number, rows in enumerate(found)]


def test_a_recording_without_readings_for_long_is_named_with_channel_and_time() -> None:
    calibration = load_calibration(load_stand().calibration)
    assert dead_sensors(runs(50), calibration, RELATIONS) == {}
    assert dead_sensors(runs(1200), calibration, RELATIONS) == {
        "run2": "load_force has no reading for 12.0 s, for at most 0.0 s in any other recording"
    }
