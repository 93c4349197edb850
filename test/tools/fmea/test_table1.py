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

"""Every row of the paper's Table 1 has a bag that is diagnosed as the table says."""

from __future__ import annotations

from pathlib import Path

import pytest
from support import in_turn
from support.places import FLEA_STAND

from flea_diag.configuration.stand import load_stand
from flea_diag.tools.fmea.catalogue_rows import known_faults, of_table1
from flea_diag.tools.fmea.failure import MISSED, UNEXPLAINED, Failure
from flea_diag.tools.fmea.failure_run import FailureRun
from flea_diag.tools.main import main
from flea_diag.wire.bags.bag import read_bag
from flea_diag.wire.records import Truth
from flea_sim_driver.failure_modes import FAILURE_MODES, ONSET_S
from flea_sim_driver.machine.library import find_machine

STAND = load_stand(FLEA_STAND)
SEED = 3
ROWS = tuple(of_table1(known_faults(STAND), find_machine("flea"), SEED))
MODES = {mode.name: mode for mode in FAILURE_MODES}


@pytest.mark.parametrize("failure", in_turn(ROWS, 2), ids=str)
def test_a_bag_of_each_failure_mode_is_diagnosed_as_the_table_says(
    failure: Failure, tmp_path: Path
) -> None:
    line = FailureRun(STAND, tmp_path)(failure)
    assert line.broken == ""
    (truth,) = (r for _, r in read_bag(tmp_path / line.bag, (Truth,)) if r.fault != "nominal")
    assert truth.fault == failure.fault
    mode = MODES[failure.name]
    if not mode.group:
        assert (line.became, line.outcome, line.remark) == (MISSED, "NOMINAL", failure.remark)
        return
    if "on_s" in mode.course and line.outcome in ("NOMINAL", "UNEXPLAINED"):
        return  # what comes and goes is named, or not at all: never as another fault
    assert line.delay_s is not None
    assert 0.0 <= line.delay_s <= 20.0
    assert set(line.group) <= set(mode.group)
    assert line.became != UNEXPLAINED
    assert "growth_s" not in mode.course or line.delay_s > 1.0


def test_the_list_says_what_the_rows_say(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["simulate", "--list"]) == 0
    shown = capsys.readouterr().out.partition("Table 1")[2].splitlines()[1:]
    assert len(shown) == 2 * len(FAILURE_MODES) == 50
    for mode, (head, rest) in zip(
        FAILURE_MODES, zip(shown[::2], shown[1::2], strict=True), strict=True
    ):
        assert head.strip() == f"{mode.component}, {mode.mode} ({mode.approach}): {mode.shown}"
        assert mode.effect in rest
        assert rest.endswith(" or ".join(mode.group) or "no alarm")


def test_the_rows_are_written_as_scenarios(tmp_path: Path) -> None:
    assert main(["scenarios", "table1", "-o", str(tmp_path), "--seed", "3"]) == 0
    assert {path.stem for path in tmp_path.glob("*.yaml")} == set(MODES)
    assert all(row.scenario["faults"][0]["onset_s"] == ONSET_S for row in ROWS)
