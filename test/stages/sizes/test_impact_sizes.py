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

"""Impacts by the whole of a recording, on simulated units whose raceway pits."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from flea_diag.configuration.calibrations import learned
from flea_diag.configuration.knowledge import knowledge
from flea_diag.configuration.stand import Stand, load_stand
from flea_diag.core.prognosis.forecast import forecast
from flea_diag.core.prognosis.size_series import SizeSeries, against_new
from flea_diag.core.prognosis.trend import trend
from flea_diag.errors import ConfigurationError
from flea_diag.stages.sizes.all_sizes import AllSizes
from flea_diag.stages.sizes.recording_sizes import RecordingSize
from flea_diag.wire.records import Truth
from flea_sim_driver.scenario.scenario_file import scenario_from_mapping
from flea_sim_driver.stand import SimulatedStand

STAND = load_stand("flea")
NUT = "impacts at the nut line"


def sizes_of(stand: Stand, fault: str) -> AllSizes:
    return AllSizes(knowledge(stand, learned(stand)), fault, stand.kinematics.orders())


def recorded(
    sized: AllSizes, pit: float, seed: int, vibration: bool = True, kind: str = "sine"
) -> dict[str, RecordingSize]:
    """Sizes of a pit in a recording of 15 s of one unit; without the observer, none of drags."""
    values = {
        "machine": "flea", "duration_s": 15.0, "seed": seed, "unit_seed": 7,
        "sensors": {"vibration": vibration}, "load": {"constant_n": 120.0},
        "motion": {"kind": kind, "amplitude_m": 0.02, "frequency_hz": 0.5, "centre_m": 0.045},
        "faults": [{"fault": "spall", "onset_s": 0.0, "size": pit}] if pit else [],
    }  # fmt: skip
    sized.begin()
    for record in SimulatedStand(scenario_from_mapping(values, "test")):
        if not isinstance(record, Truth):
            sized.add(record)
    return {row.of.name: row for row in sized.sizes()}


@pytest.mark.slow
def test_a_pit_that_grows_is_followed_at_its_line_and_its_end_foretold() -> None:
    """By a tenth of the limit a day: days 3 to 6 say when day 10 will be."""
    sized, times = sizes_of(STAND, "spall"), [3.0, 4.0, 5.0, 6.0]
    as_new = [recorded(sized, 0.0, seed)[NUT] for seed in (1, 2)]
    worn = [recorded(sized, 0.08 * time, 10 + int(time)) for time in times]
    limit = recorded(sized, 0.8, 30)[NUT].size - as_new[0].size

    def series(rows: list[RecordingSize], at: list[float]) -> SizeSeries:
        return SizeSeries.of(at, [row.size for row in rows], [row.error for row in rows])

    at_nut = against_new(series([row[NUT] for row in worn], times), series(as_new, [0.0, 1.0]))
    line = trend(at_nut)
    assert line.direction == "grows"
    assert line.slope == pytest.approx(limit / 10.0, rel=0.3)
    assert line.slope > 2.0 * line.slope_sigma
    found = forecast(at_nut)
    assert found is not None
    end = found.crossing(limit)
    assert end.low_s < 10.0 < end.high_s
    assert end.median_s == pytest.approx(10.0, abs=2.5)
    for row in worn:
        (at_screw,) = (size for name, size in row.items() if "screw" in name)
        assert at_screw.size < 0.5 * row[NUT].size, "the line of the part that is whole"


@pytest.mark.slow
def test_what_a_recording_lacks_for_it_is_said() -> None:
    sized = sizes_of(STAND, "spall")
    assert recorded(sized, 0.4, 1, vibration=False) == {}
    assert sized.lacks == "no vibration of accelerometer_2 was recorded"
    assert recorded(sized, 0.4, 1, kind="hold") == {}
    assert sized.lacks == "nothing moved for long enough"
    assert math.isfinite(recorded(sized, 0.4, 1)[NUT].load_n)
    assert sized.lacks == ""


def test_what_would_show_it_is_named_where_nothing_does() -> None:
    with pytest.raises(ConfigurationError, match=r"has no size by these channels.*a position on "):
        sizes_of(STAND, "backlash")
    with pytest.raises(ConfigurationError, match="choose among jam"):
        sizes_of(STAND, "rust")
    no_screw = replace(STAND, kinematics=type(STAND.kinematics)())
    assert sizes_of(no_screw, "spall").lacks == "", "its drag is left"
