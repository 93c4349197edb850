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

"""The hard stops of the simulated stand: where they hold, and who reads their reaction."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from support.stand_runs import records, scans, scenario

from flea_diag.errors import ConfigurationError

PAST = {"kind": "trapezoid", "amplitude_m": 0.02, "centre_m": 0.09, "frequency_hz": 0.1}
FORCE_CONSTANT, CURRENT_OFFSET = 176.7, 0.32


def pressed(**travel: Any) -> dict[str, float]:
    """Means over a stand against the upper stop, of a unit without spread."""
    run = scans(records(motion=PAST, unit_spread=0.0, travel={"overtravel_m": 0.01, **travel}))
    return {name: float(column[300:480].mean()) for name, column in run.items()}


@pytest.mark.parametrize("stopped", ["nut", "load_side"])
def test_it_stands_at_the_stop(stopped: str) -> None:
    run = pressed(stopped=stopped)
    assert run["actuator_position"] == pytest.approx(0.1, abs=0.5e-3)
    assert abs(run["motor_speed"]) < 1.0


def test_no_sensor_reads_the_reaction_of_a_stop_that_holds_the_nut() -> None:
    """The motor pushes with K (i - i0), and the load cell reads none of it."""
    run = pressed(stopped="nut")
    push = FORCE_CONSTANT * (run["motor_current"] - CURRENT_OFFSET)
    assert push > 200.0
    assert abs(run["load_force"]) < 50.0


def test_the_load_cell_reads_the_reaction_of_a_stop_beyond_it() -> None:
    run = pressed(stopped="load_side")
    push = FORCE_CONSTANT * (run["motor_current"] - CURRENT_OFFSET)
    assert run["load_force"] == pytest.approx(push, abs=60.0)


def test_a_stop_may_be_inside_the_range() -> None:
    run = pressed(stopped="nut", high_m=0.0985, overtravel_m=0.012)
    assert run["actuator_position"] == pytest.approx(0.0985, abs=0.5e-3)


def test_a_run_that_is_commanded_beyond_a_stop_begins_at_it() -> None:
    run = scans(records(motion={"kind": "hold", "centre_m": 0.1}, travel={"high_m": 0.095,
                        "overtravel_m": 0.005}, duration_s=1.0))  # fmt: skip
    assert np.abs(run["actuator_position"] - 0.095).max() < 1e-3


def test_a_command_past_the_stops_is_refused_beyond_what_the_scenario_allows() -> None:
    with pytest.raises(ConfigurationError) as refused:
        scenario(motion=PAST, travel={"overtravel_m": 0.005})
    for word in ("0.1100", "end stops", "0.0100", "overtravel_m", "0.005"):
        assert word in str(refused.value)
