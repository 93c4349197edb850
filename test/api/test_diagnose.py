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

"""A diagnosis from a bag, frames, datasets, arrays and rows: the same, and refused where wrong."""

from __future__ import annotations

import gc
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from support.decisions import BAGS, expected

import flea_diag as fd
from flea_diag.api.stand_facts import channels_of
from flea_diag.configuration.component import make_pipeline
from flea_diag.configuration.stand import load_stand
from flea_diag.tools.replay.replay import replay

BAG = BAGS / "winding_short"


@pytest.fixture(scope="module")
def run() -> fd.Recording:
    return fd.open(BAG)


@pytest.fixture(scope="module")
def result(run: fd.Recording) -> fd.Diagnosis:
    return fd.diagnose(run)


def test_a_bag_is_diagnosed_as_the_command_does(result: fd.Diagnosis) -> None:
    told = replay(BAG, make_pipeline(load_stand()))
    assert result.digest == told["digest"]
    assert result.summary["episodes"] == told["episodes"]
    assert [row.fault for row in result.group] == expected("winding_short")["ambiguity_group"]
    assert result.outcome == "ISOLATED"
    assert result.truth[-1].fault == "winding_short"
    assert {"run", "urgency", "part"} <= set(result.to_do)


@pytest.mark.in_turn(2)
def test_what_is_in_memory_gives_the_same_digest(run: fd.Recording, result: fd.Diagnosis) -> None:
    frame = run.frame()
    dated = frame.set_index(pd.to_datetime(frame.index * 1e9 + result.start_ns))
    # Whole nanoseconds as a float64 of 2010 lose some 100 ns: the stamps are set from the frame.
    dated.index = pd.DatetimeIndex(run.stamps_ns)
    for data in (frame, dated, run.dataset(), run.table, dict(run.table) | {}):
        if isinstance(data, dict):  # no attributes: no ranges, and another date
            assert fd.diagnose(data, residuals=False).group[0].fault == "winding_short"
        else:
            assert fd.diagnose(data, residuals=False).digest == result.digest


def test_rows_one_by_one_end_in_the_same_verdict(run: fd.Recording, result: fd.Diagnosis) -> None:
    stream, table = fd.Stream("flea"), run.table
    names = [name for name in table if name != "time_s"]
    said = []
    for k, time_s in enumerate(table["time_s"]):
        said += stream.push(float(time_s), {name: float(table[name][k]) for name in names})
    said += stream.finish()
    assert [verdict.outcome.value for verdict in said][-1] == result.outcome
    assert [row.fault for row in stream.group] == [row.fault for row in result.group]
    assert stream.reset()[-1].episode == 0


def test_the_tables_hold_what_was_said(result: fd.Diagnosis) -> None:
    residuals, verdicts, evidence = result.residuals, result.verdicts, result.evidence
    beyond = np.abs(residuals["parity_mechanical_dn/z"]) > residuals["parity_mechanical_dn/limit"]
    first_s = residuals["time_s"][beyond][0]
    assert first_s == pytest.approx(result.episodes[0].detected_at_s, abs=0.5)
    assert verdicts["outcome"][-1] == "ISOLATED"
    assert verdicts["members"][-1] == "winding_short"
    assert set(evidence["fault"][evidence["possible"] == 1.0]) == {"winding_short"}
    assert residuals.rows == len(residuals.frame()) == residuals.dataset().sizes["time_s"]


def test_a_notebook_shows_it(run: fd.Recording, result: fd.Diagnosis) -> None:
    assert "winding_short" in result._repr_html_()
    assert "motor_current [A]" in run._repr_html_()
    figure = result.plot()
    assert [len(panel.lines) for panel in figure.axes] == [4, 4, 4, 4, 0]
    assert len(result.plot(["parity_drive"]).axes) == 2
    with pytest.raises(fd.FleaError, match="'parity' is unknown, choose among parity_mech"):
        result.plot(["parity"])
    with pytest.raises(fd.FleaError, match="no residuals were kept"):
        fd.diagnose(run, residuals=False).residuals  # noqa: B018


def test_tables_are_written_and_read(run: fd.Recording, tmp_path: Path) -> None:
    for name in ("run.csv", "run.csv.gz", "run.parquet"):
        again = fd.open(run.table.save(tmp_path / name)).table
        np.testing.assert_array_equal(again["motor_current"], run.table["motor_current"])
    with pytest.raises(fd.FleaError, match=r"'\.xls' is no format of a table: name it \.csv"):
        run.table.save(tmp_path / "run.xls")


def test_a_channel_that_was_not_recorded_is_no_reason_to_refuse(
    run: fd.Recording, tmp_path: Path
) -> None:
    """Real recordings of the FLEA name a load position, and have none."""
    frame = run.frame()
    frame["load_position"] = np.nan
    assert fd.diagnose(frame, residuals=False).group[0].fault == "winding_short"
    table = fd.Table({**run.table, "load_position": np.full(run.table.rows, np.nan)})
    again = fd.open(table.save(tmp_path / "run.csv"))
    assert "load_position" not in again.table
    without = fd.diagnose(run.frame().drop(columns="load_position"), residuals=False)
    assert fd.diagnose(again, residuals=False).outcome == without.outcome


def bad(frame: Any, **changes: Any) -> Any:
    return frame.assign(**changes)


def _own(frame: Any) -> Any:
    """A frame that no recording was made into."""
    frame.attrs = {}
    return frame


WRONG: dict[str, tuple[Any, str]] = {
    "name": (
        lambda f: f.rename(columns={"motor_current": "motor_curent"}),
        r"column 'motor_curent' is no channel of stand flea: rename it if motor_current is meant",
    ),
    "stranger": (lambda f: bad(f, day=1.0), "column 'day' is no channel of stand flea: drop it"),
    "unsorted": (lambda f: f[::-1], r"row 1 .* is earlier than .* frame\.sort_index"),
    "duplicate": (
        lambda f: f.iloc[[0, 1, 1, 2]],
        r"row 2 .* repeats the time .*duplicated",
    ),
    "words": (lambda f: bad(f, motor_current="off"), "'motor_current' is of type .* 'off' in it"),
    "NaN": (
        lambda f: _own(bad(f, motor_current=np.nan)),
        "'motor_current' holds no reading .*: drop it",
    ),
    "inf": (lambda f: bad(f, motor_current=np.inf), "'motor_current': row 0 is infinite"),
    "no times": (
        lambda f: f.reset_index(drop=True),
        "the rows have no times: name a column",
    ),
    "NaT": (lambda f: f.set_index(f.index.where(f.index != 0.01)), "row 1 has no time: drop it"),
    "rate": (lambda f: f.iloc[::2], "a row comes every 0.02 s, .* is for 0.01 s: resample"),
    "short": (lambda f: f.iloc[:1], "1 rows: at least 2 are needed"),
    "no table": (lambda f: 3, "int is no recording: give a path"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_frames_are_refused_in_one_line(run: fd.Recording, case: str) -> None:
    spoil, words = WRONG[case]
    with pytest.raises(fd.FleaError, match=words) as refused:
        fd.diagnose(spoil(run.frame()))
    assert "\n" not in str(refused.value)


def test_units_and_stands_are_checked(run: fd.Recording) -> None:
    with pytest.raises(fd.FleaError, match="column motor_current is in 'mA', must be in 'A'"):
        fd.diagnose(run.frame(), units={"motor_current": "mA"})
    with pytest.raises(fd.FleaError, match="stand 'nope' is not shipped, known are"):
        fd.diagnose(run, "nope")
    with pytest.raises(fd.FleaError, match="does not exist"):
        fd.open("nowhere.csv")
    stream = fd.Stream()
    stream.push(1.0, {"motor_current": 1.0})
    with pytest.raises(fd.FleaError, match=r"time_s = 1\.0: must be later"):
        stream.push(1.0, {"motor_current": 1.0})


def test_a_channel_is_in_the_unit_of_its_description() -> None:
    assert channels_of(load_stand("joint"))["actuator_position"] == "rad"
    assert channels_of(load_stand("flea"))["actuator_position"] == "m"


@pytest.mark.parametrize(
    ("runs", "words"),
    [([], "a list of 2 nominal"), ("bag", "a list of 2 nominal"), ([BAG], "truth is 'winding_sho")],
)
def test_runs_that_cannot_calibrate_are_refused(runs: Any, words: str) -> None:
    with pytest.raises(fd.FleaError, match=words):
        fd.calibrate(runs)


def test_the_process_of_the_user_keeps_its_garbage_collection(run: fd.Recording) -> None:
    before = gc.get_threshold()
    with pytest.raises(fd.FleaError):
        fd.diagnose(3)
    fd.diagnose(run, residuals=False)
    assert gc.get_threshold() == before
