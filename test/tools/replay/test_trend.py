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

"""The line through estimates, and the command that collects them from bags."""

from __future__ import annotations

import csv
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.live import ROOT
from support.verdicts import LAST, START

from flea_diag.core.likelihood.trend import trend
from flea_diag.tools.main import main as flea
from flea_diag.tools.replay.trend import estimates
from flea_diag.wire.bags.bag import BagWriter, read_bag
from flea_diag.wire.records import Candidate, ChannelInfo, ChannelTable, Outcome, Truth

DAY = 86_400 * 10**9


def test_the_line_is_that_of_weighted_least_squares() -> None:
    random = np.random.default_rng(3)
    t = np.sort(random.uniform(0.0, 100.0, 12))
    sigma = random.uniform(0.5, 2.0, 12)
    y = 5.0 + 0.3 * t + sigma * random.normal(size=12)
    (slope, offset), covariance = np.polyfit(t, y, 1, w=1.0 / sigma, cov="unscaled")
    line = trend(t, y, sigma)
    assert line.slope == pytest.approx(slope)
    assert line.level == pytest.approx(offset + slope * line.middle)
    scatter = float(np.sum(((y - offset - slope * t) / sigma) ** 2)) / 10
    expected = math.sqrt(covariance[0, 0]) * math.sqrt(max(1.0, scatter))
    assert line.slope_sigma == pytest.approx(expected)
    assert line.direction == "grows"


def test_the_stated_error_of_the_slope_is_the_scatter_of_slopes() -> None:
    random = np.random.default_rng(7)
    t = np.linspace(0.0, 10.0, 8)
    lines = [trend(t, random.normal(0.0, 1.0, 8), np.ones(8)) for _ in range(2000)]
    # Birge's ratio never falls below one, so the errors stated are a little too large.
    stated = np.mean([line.slope_sigma for line in lines])
    assert stated == pytest.approx(np.std([line.slope for line in lines]), rel=0.2)
    false = np.mean([line.direction != "no trend is shown" for line in lines])
    assert false < 0.06


def test_one_time_gives_no_slope() -> None:
    for line in (trend([1.0], [2.0], [0.1]), trend([1.0, 1.0], [2.0, 3.0], [0.1, 0.1])):
        assert math.isnan(line.slope)
        assert line.direction == "no trend is shown"


def bag(folder: Path, name: str, serial: str, day: int, size: float) -> Path:
    table = ChannelTable(
        START + day * DAY, "s", (ChannelInfo("motor_current", "A", -9, 9, 100, serial),)
    )
    member = Candidate("jam", "friction+", 1.0, "fits", (), size, 2.0, "N")
    verdict = replace(
        LAST,
        stamp_ns=START + day * DAY,
        detected_stamp_ns=START + day * DAY - 10**9,
        members=(member,),
    )
    with BagWriter(folder / name, whole_every_s=None) as writer:
        writer.write(table)
        writer.write(replace(verdict, outcome=Outcome.DETECTED, stamp_ns=verdict.stamp_ns - 1))
        writer.write(verdict)
    return folder / name


@pytest.fixture
def bags(tmp_path: Path) -> list[str]:
    made = [bag(tmp_path, f"day_{day}", "EMA-7", day, 10.0 + 3.0 * day) for day in range(4)]
    made.append(bag(tmp_path, "other", "EMA-8", 1, 50.0))
    return list(map(str, made))


def test_one_actuator_over_its_bags(
    bags: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target = tmp_path / "trend.json"
    assert flea(["trend", *bags, "--json", str(target)]) == 0
    told = capsys.readouterr().out
    assert (
        "EMA-7        jam                        14.5 ± 1 N, 4 estimates: +3 ± 0.89 N a day, "
        in (told)
    )
    assert "EMA-8        jam                        50 ± 2 N, 1 estimate: no trend" in told
    one, other = json.loads(target.read_text("utf-8"))["trends"]
    assert one["slope_per_s"] * 86400 == pytest.approx(3.0)
    assert one["direction"] == "grows"
    assert other["slope_per_s"] is None


def test_only_the_serial_that_is_asked_for_and_a_line_an_estimate(
    bags: list[str], tmp_path: Path
) -> None:
    target = tmp_path / "trend.csv"
    assert flea(["trend", *bags, "--serial", "EMA-7", "--csv", str(target)]) == 0
    rows = list(csv.DictReader(target.open(encoding="utf-8")))
    assert [float(row["size"]) for row in rows] == [10.0, 13.0, 16.0, 19.0]
    assert {row["serial"] for row in rows} == {"EMA-7"}
    assert {row["outcome"] for row in rows} == {"ISOLATED"}, "one line an episode, its last word"


def test_progpy_takes_it_over(bags: list[str], tmp_path: Path) -> None:
    results = pytest.importorskip("progpy.sim_result", reason="pip install progpy")
    target = tmp_path / "trend.json"
    assert flea(["trend", *bags, "--serial", "EMA-7", "--json", str(target)]) == 0
    (one,) = json.loads(target.read_text("utf-8"))["trends"]
    taken = results.SimResult(one["times"], one["data"])
    assert [row["size"] for row in taken] == [10.0, 13.0, 16.0, 19.0]
    assert taken.times[-1] == 3 * 86400.0


def test_the_notebook_of_progpy_says_when_the_limit_is_reached(
    bags: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """10, 13, 16, 19 a day apart: twice the last is 19 / 3 days away."""
    pytest.importorskip("progpy", reason="pip install progpy")
    monkeypatch.chdir(tmp_path)
    assert flea(["trend", *bags, "--serial", "EMA-7", "--json", "trend.json"]) == 0
    notebook = json.loads((ROOT / "docs" / "notebooks" / "trend_progpy.ipynb").read_text("utf-8"))
    names: dict[str, Any] = {}
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code":
            exec("".join(cell["source"]), names)
    assert names["remaining_days"] == pytest.approx(19 / 3, abs=0.06)


def test_a_recording_without_a_serial_or_a_verdict_is_diagnosed_and_kept_apart(
    tmp_path: Path,
) -> None:
    with BagWriter(tmp_path / "unnamed") as writer:
        for _, record in read_bag(ROOT / "bags" / "winding_short"):
            if isinstance(record, ChannelTable):
                unnamed = tuple(replace(row, serial="") for row in record.channels)
                record = replace(record, channels=unnamed)
            if isinstance(record, Truth):
                record = replace(record, details=())
            writer.write(record)
    found = estimates(tmp_path / "unnamed")
    assert {entry.fault for entry in found} == {"winding_short"}
    assert {entry.serial for entry in found} == {"unknown"}
    assert all(entry.size_sigma > 0.0 for entry in found)


def test_a_fault_belongs_to_the_unit_that_was_switched_in(tmp_path: Path) -> None:
    made = Path(bag(tmp_path, "switched", "EMA-7", 0, 10.0))
    records = [record for _, record in read_bag(made)]
    with BagWriter(tmp_path / "told") as writer:
        writer.write(records[0])
        writer.write(Truth(START, "jam", START, (("serial", "EMA-9"),)))
        for record in records[1:]:
            writer.write(record)
    assert {entry.serial for entry in estimates(made)} == {"EMA-7"}
    assert {entry.serial for entry in estimates(tmp_path / "told")} == {"EMA-9"}


def test_a_recorded_verdict_is_taken_as_it_is() -> None:
    (entry,) = estimates(ROOT / "bags" / "live_motor_current_bias")
    truth = [r for _, r in read_bag(ROOT / "bags" / "live_motor_current_bias", (Truth,))][-1]
    assert isinstance(truth, Truth)
    put_in = float(dict(truth.details)["size"].split()[0])
    assert abs(entry.size - put_in) < 3 * entry.size_sigma
    assert (entry.fault, entry.unit) == ("motor_current_bias", "A")


def test_no_bag_is_refused_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert flea(["trend", str(tmp_path / "nothing")]) == 2
    assert "nothing" in capsys.readouterr().err
