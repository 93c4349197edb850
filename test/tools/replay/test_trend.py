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

"""The command that collects the sizes of faults from bags, and says how they grow."""

from __future__ import annotations

import csv
import json
import math
import re
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from support.live import ROOT
from support.verdicts import LAST, START

from flea_diag.tools.main import main as flea
from flea_diag.tools.replay.size_estimates import estimates
from flea_diag.wire.bags.bag import BagWriter, read_bag
from flea_diag.wire.records import Candidate, ChannelInfo, ChannelTable, Outcome, Truth
from flea_sim_driver.scenario.scenario_file import scenario_from_mapping
from flea_sim_driver.stand import SimulatedStand

DAY = 86_400 * 10**9


def bag(
    folder: Path, name: str, serial: str, day: int, size: float, own: float = math.nan, by: str = ""
) -> Path:
    """A bag with one verdict; ``own`` error of its size, calibration ``by`` which it was made."""
    table = ChannelTable(
        START + day * DAY, "s", (ChannelInfo("motor_current", "A", -9, 9, 100, serial),)
    )
    member = Candidate("jam", "friction+", 1.0, "fits", (), size, 2.0, "N", own)
    verdict = replace(
        LAST,
        stamp_ns=START + day * DAY,
        detected_stamp_ns=START + day * DAY - 10**9,
        members=(member,),
        calibration_sha256=by,
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
        "EMA-7        jam                        14.5 ± 0.82 N, 4 estimates: +3 ± 0.73 N a day, "
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


def test_a_trend_is_drawn(
    bags: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("matplotlib")
    target = tmp_path / "trend.svg"
    assert flea(["trend", *bags, "--plot", str(target), "--limit", "40"]) == 0
    drawn = target.read_text(encoding="utf-8")
    assert {"EMA-7: jam", "EMA-8: jam", "forecast, 90 %", "limit"} <= _comments(drawn)
    assert any(words.startswith("reached 20") for words in _comments(drawn))
    assert flea(["trend", *bags, "--plot", "trend.doc"]) == 2
    assert "must end in .png" in capsys.readouterr().err


def _comments(drawn: str) -> set[str]:
    """Texts of a picture: matplotlib writes each beside its glyphs."""
    return {words.strip() for words in re.findall(r"<!--(.*?)-->", drawn, re.DOTALL)}


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


def said(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """What the command prints, its lines as one."""
    assert flea(["trend", *map(str, arguments)]) == 0
    return " ".join(capsys.readouterr().out.split())


@pytest.fixture
def split(tmp_path: Path) -> list[Path]:
    """A unit whose sizes are known to 2 N, of which 0.3 N are of each recording by itself."""
    return [bag(tmp_path, f"own_{day}", "EMA-7", day, 10.0 + day, 0.3) for day in range(5)]


def test_verdicts_that_split_their_error_show_growth_at_once(
    split: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target = tmp_path / "trend.json"
    words = said(capsys, *split[:3], "--limit", 20, "--json", target)
    assert "N a day, grows growth by probability: linear" in words
    assert "limit 20 N is reached" in words
    (one,) = json.loads(target.read_text("utf-8"))["trends"]
    assert one["own_sigmas"] == pytest.approx([0.3] * 3)
    assert one["sigmas"] == pytest.approx([2.0] * 3)
    low, median, high = (one["crossing"][key] for key in ("low_s", "median_s", "high_s"))
    assert low < 10.0 * 86400.0 < high
    assert low < median < high
    whole = [bag(tmp_path, f"whole_{day}", "EMA-7", day, 10.0 + day) for day in range(3)]
    words = said(capsys, *whole)
    assert "no trend is shown" in words
    assert "--calibration FILE diagnoses them again and tells it" in words
    assert "more recordings like these" in words


def test_a_limit_that_is_crossed_is_said(
    split: list[Path], capsys: pytest.CaptureFixture[str]
) -> None:
    assert "limit 5 N is crossed already, with probability" in said(capsys, *split, "--limit", 5)


def test_one_recording_is_told_what_it_lacks(
    split: list[Path], capsys: pytest.CaptureFixture[str]
) -> None:
    assert "a trend needs 2 recordings at different times, a forecast 3" in said(capsys, split[0])
    assert "a forecast needs 3 recordings" in said(capsys, split[0], split[4], "--limit", 20)


def test_no_trend_goes_over_two_calibrations(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    made = [bag(tmp_path, f"by_{k}", "EMA-7", k, 10.0 + k, 0.3, "ab"[k // 2]) for k in range(4)]
    words = said(capsys, *made)
    assert "sizes by 2 calibrations" in words
    assert "grows" not in words


def test_a_size_that_falls_is_taken_as_a_repair(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sizes = (10.0, 15.0, 20.0, 3.0, 5.0, 7.0)
    made = [bag(tmp_path, f"day_{k}", "EMA-7", k, size, 0.3) for k, size in enumerate(sizes)]
    words = said(capsys, *made)
    assert "falls from 20 to 3 N, which is no growth: taken as a repair" in words
    assert "the trend is of the 3 since" in words
    assert "3 estimates: +2 " in words


def test_two_units_have_a_trend_each_and_one_limit_holds_for_both(
    split: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = [bag(tmp_path, f"other_{k}", "EMA-8", k, 30.0 - k, 0.3) for k in range(3)]
    words = said(capsys, *split, *other, "--limit", 20)
    assert words.index("EMA-7 jam") < words.index("EMA-8 jam")
    assert "N a day, shrinks" in words


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (("--new", "nothing"), "--new needs --fault"),
        (("--limit", "0"), "must be a number above 0"),
        (("--law", "square"), "'square' is unknown, choose from"),
        (("--fault", "rust"), "fault 'rust' has no size by these channels, choose among"),
        (("--fault", "jam", "--stand", "none"), "none"),
    ],
    ids=lambda value: value[0] if isinstance(value, tuple) else None,
)
def test_what_makes_no_sense_is_refused_in_one_line(
    split: list[Path], more: tuple[str, ...], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    try:
        status = flea(["trend", *map(str, split), *more])
    except SystemExit as ended:
        status = ended.code
    assert status == 2
    assert words in capsys.readouterr().err


def test_a_limit_of_several_sizes_is_refused(
    split: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    biased = ROOT / "bags" / "live_motor_current_bias"
    assert flea(["trend", str(split[0]), str(biased), "--limit", "5"]) == 2
    told = capsys.readouterr().err
    assert "is of one size, and these bags give several (" in told
    assert "choose one with --fault and --size" in told


@pytest.fixture(scope="module")
def worn(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Five days of one unit: two as new, then turns are lost, too few for any alarm at first."""
    folder = tmp_path_factory.mktemp("worn")
    for day, share in enumerate((0.0, 0.0, 0.05, 0.1, 0.15)):
        values = {
            "machine": "flea", "duration_s": 20.0, "seed": 40 + day, "unit_seed": 7,
            "start_s": 1.7e9 + 86400.0 * day, "sensors": {"vibration": False},
            "motion": {"kind": "sine", "amplitude_m": 0.02, "frequency_hz": 0.5, "centre_m": 0.045},
            "faults": [{"fault": "winding_short", "size": share}] if share else [],
        }  # fmt: skip
        with BagWriter(folder / f"day_{day}", whole_every_s=None) as writer:
            for record in SimulatedStand(scenario_from_mapping(values, "worn")):
                writer.write(record)
    return folder


def test_every_recording_gives_a_size_against_the_unit_as_new(
    worn: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target = tmp_path / "trend.csv"
    days = sorted(worn.iterdir())
    asked = ["--fault", "winding_short", "--size", "resistance lost", "--csv", target]
    words = said(capsys, *days[2:], *asked, "--new", *days[:2], "--limit", 1.0)
    assert "winding_short resistance lost" in words
    assert "ohm a day, grows" in words
    assert "limit 1 ohm is reached" in words
    rows = list(csv.DictReader(target.open(encoding="utf-8")))
    assert {row["outcome"] for row in rows} == {"MEASURED"}
    for row in rows:
        assert float(row["size_sigma"]) > 4.0 * float(row["size_sigma_own"])
    level = float(words.split("resistance lost ")[1].split(" ")[0])
    assert level == pytest.approx(0.1 * 2.95, abs=0.1), "the middle of the three, of 2.95 ohm"


@pytest.mark.in_turn(2)
def test_the_catalogue_may_state_the_limit(
    worn: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """In multiples of the calibrated resistance of 2.95 ohm, as all bounds of this size."""
    stand = tmp_path / "stand"
    shutil.copytree(ROOT / "config" / "stands" / "flea", stand)
    text = (stand / "faults.yaml").read_text(encoding="utf-8")
    name = "- name: resistance lost\n"
    assert text.count(name) == 1
    place = text.index(name) + len(name)
    (stand / "faults.yaml").write_text(text[:place] + " " * 12 + "limit: 0.4\n" + text[place:])
    days = sorted(worn.iterdir())
    asked = ["--fault", "winding_short", "--size", "resistance lost", "--stand", stand]
    words = said(capsys, *days[2:], *asked, "--new", *days[:2])
    limit = float(words.split("limit ")[1].split(" ohm")[0])
    assert limit == pytest.approx(0.4 * 2.95, rel=0.1)


def test_bags_of_another_unit_are_none_of_this_one_as_new(
    worn: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with BagWriter(tmp_path / "other") as writer:
        for _, record in read_bag(worn / "day_0"):
            if isinstance(record, ChannelTable):
                rows = tuple(replace(row, serial="EMA-9") for row in record.channels)
                record = replace(record, channels=rows)
            writer.write(record)
    asked = ["--fault", "winding_short", "--new", str(tmp_path / "other")]
    assert flea(["trend", str(worn / "day_2"), *asked]) == 2
    assert "--new: none of these bags is of the unit" in capsys.readouterr().err


def test_a_recording_of_two_units_is_refused(
    worn: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with BagWriter(tmp_path / "two") as writer:
        writer.write(Truth(START, "jam", START, (("serial", "EMA-9"),)))
        for _, record in read_bag(worn / "day_0"):
            writer.write(record)
    assert flea(["trend", str(tmp_path / "two"), "--fault", "winding_short"]) == 2
    assert "two units in one recording" in capsys.readouterr().err
