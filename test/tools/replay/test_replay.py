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

"""Replay: the summary on diagnoses made by hand, the command on bags, good and bad."""

from __future__ import annotations

import json
import math
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from support.decisions import BAGS
from support.screens.judgements import GONE, HALF, LOST, WHOLE, told

from flea_diag.configuration.files import config_path
from flea_diag.errors import ConfigurationError, RecordingError
from flea_diag.stages.digest import decision_digest, digest
from flea_diag.stages.pipeline import Pipeline
from flea_diag.tools.main import main
from flea_diag.tools.replay import replay as module
from flea_diag.tools.replay.replay import replay
from flea_diag.tools.replay.summary import in_words, summarise, without_values
from flea_diag.wire import records as r
from flea_diag.wire.bags.bag import BagReader, BagWriter
from flea_diag.wire.records import Outcome, Quality

START_NS = 1_283_500_000 * 10**9
SECOND = 10**9


def at(seconds: float) -> int:
    return START_NS + round(seconds * SECOND)


def scan(seconds: float, value: float = 0.0) -> r.Scan:
    return r.Scan(at(seconds), ("motor_current",), (value,))


def group(seconds: float, outcome: Outcome, *members: str, **changes: Any) -> r.AmbiguityGroup:
    episode = changes.pop("episode", 1)
    return r.AmbiguityGroup(
        stamp_ns=at(seconds),
        outcome=outcome,
        episode=episode,
        step=0,
        seq=0,
        members=tuple(r.Candidate(fault, "", 1 / len(members), "fits") for fault in members),
        dropped=(),
        detected_stamp_ns=at(changes.pop("detected", seconds)) if episode else r.NEVER_NS,
        words="words",
        calibration_sha256="",
        source="replay",
        **changes,
    )


def quality(seconds: float, state: Quality, since: float, reason: str = "") -> r.DataQuality:
    row = r.ChannelQuality("motor_voltage", state, at(since), reason, (("samples", 7),))
    return r.DataQuality(at(seconds), (row,))


def test_scans_are_summarised_by_their_stamps_alone() -> None:
    """A day of scans: eight bytes of each are kept, not all channels."""
    bag = BAGS / "nominal"
    blocks = list(BagReader(bag).blocks((r.Scan,)))
    light = [without_values(block) for block in blocks]
    assert sum(block.values.nbytes for block in light) == 0
    assert summarise(light) == summarise(blocks)
    assert summarise(light)["scans"] == 1600


def test_a_quiet_run() -> None:
    rates = {"stated_false_alarms_per_hour": 0.1, "supported_false_alarms_per_hour": 12.0}
    spall = ("spall", "no accelerometer")
    records = [
        scan(0.0),
        group(0.0, Outcome.NOT_OBSERVABLE, episode=0),
        group(3.0, Outcome.NOMINAL, episode=0, not_observable=(spall,), **rates),
        scan(29.99),
    ]
    summary = summarise(records)
    assert summary == {
        "schema_version": 1,
        "outcome": "NOMINAL",
        "detected_at_s": None,
        "isolated_at_s": None,
        "ambiguity_group": [],
        "episodes": [],
        "looked_for": [],
        "not_observable": [{"fault": "spall", "reason": "no accelerometer"}],
        "false_alarms_per_hour": {"stated": 0.1, "supported": 12.0},
        "features_computed": [],
        "data_quality": {},
        "judged": [],
        "shows_from": {},
        "digest": digest(records),
        "decision_digest": decision_digest(records),
        "scans": 2,
        "duration_s": 29.99,
    }
    assert (
        in_words({**summary, "bag": "b"})
        == "b: NOMINAL\n  not observable: spall (no accelerometer)"
    )


@pytest.mark.parametrize("load_cell", [WHOLE, HALF, GONE])
def test_what_was_judged_is_a_list_and_what_was_not_is_in_the_words(load_cell: str) -> None:
    summary = summarise(told(load_cell))
    rows = json.loads(json.dumps(summary["judged"]))
    silent = {HALF: 0.35, GONE: 0.0}.get(load_cell)
    words = in_words({**summary, "bag": "b"})
    if silent is None:
        assert all(row["judged"] for row in rows)
        assert "not judged" not in words
    else:
        assert rows[0] == {
            "test": "parity_mechanical", "last_10_s": 0.0, "run": pytest.approx(silent, abs=0.01),
            "judged": False, "cause": "missing", "why": "load_force lacks all of its readings",
        }  # fmt: skip
        assert {row["test"] for row in rows if not row["judged"]} == set(LOST)
        assert (
            f"  not judged: {', '.join(LOST)} (load_force lacks all of its readings; "
            f"0% of the last 10 s, {silent:.0%} of the run)"
        ) in words
    hidden = {row["fault"] for row in summary["not_observable"]}
    assert not hidden & set(summary["looked_for"])
    assert ("jam" in summary["looked_for"]) == (load_cell == WHOLE)
    assert ("jam" in hidden) == (load_cell != WHOLE)


def test_a_group_that_shrinks_to_one() -> None:
    summary = summarise(
        [
            scan(0.0),
            group(8.5, Outcome.DETECTED, "jam", "backlash"),
            group(9.0, Outcome.ISOLATED, "backlash", detected=8.5),
            group(9.5, Outcome.ISOLATED, "jam", detected=8.5),
            group(10.5, Outcome.ISOLATED, "jam", detected=8.5),
        ]
    )
    assert summary["outcome"] == "ISOLATED"
    assert summary["detected_at_s"] == 8.5
    assert summary["isolated_at_s"] == 9.5
    assert summary["ambiguity_group"] == ["jam"]


def test_a_group_that_cannot_be_split_was_never_isolated() -> None:
    summary = summarise(
        [
            scan(0.0),
            group(8.5, Outcome.DETECTED, "jam", "ball_nut_friction", "backlash"),
            group(9.5, Outcome.INDISTINGUISHABLE, "jam", "ball_nut_friction", detected=8.5),
            group(10.0, Outcome.INDISTINGUISHABLE, "ball_nut_friction", "jam", detected=8.5),
        ]
    )
    assert summary["isolated_at_s"] is None
    assert summary["episodes"][0]["settled_at_s"] == 9.5
    assert summary["ambiguity_group"] == ["ball_nut_friction", "jam"]


def test_the_first_episode_stands_at_the_top_and_each_for_itself() -> None:
    summary = summarise(
        [
            scan(0.0),
            group(5.0, Outcome.ISOLATED, "jam"),
            group(40.0, Outcome.NOMINAL, episode=0),
            group(50.0, Outcome.ISOLATED, "motor_current_bias", episode=2),
        ]
    )
    assert summary["ambiguity_group"] == ["jam"]
    assert [
        (e["episode"], e["detected_at_s"], e["ambiguity_group"]) for e in summary["episodes"]
    ] == [
        (1, 5.0, ["jam"]),
        (2, 50.0, ["motor_current_bias"]),
    ]


def test_every_bad_stretch_of_a_channel_is_told() -> None:
    summary = summarise(
        [
            scan(0.0),
            quality(0.0, Quality.GOOD, 0.0),
            quality(5.0, Quality.BAD, 4.5, "disagrees"),
            quality(6.0, Quality.BAD, 4.5, "disagrees"),
            quality(9.0, Quality.GOOD, 8.5),
            quality(12.0, Quality.SATURATED, 12.0, "at its limit"),
        ]
    )
    assert summary["data_quality"]["motor_voltage"] == {
        "quality": "saturated",
        "reason": "at its limit",
        "counters": {"samples": 7},
        "last_reading_s": None,
        "stretches": [
            {"quality": "bad", "reason": "disagrees", "from_s": 4.5, "to_s": 8.5},
            {"quality": "saturated", "reason": "at its limit", "from_s": 12.0, "to_s": None},
        ],
    }
    words = in_words({**summary, "bag": "b"}).splitlines()
    assert words[1] == "  motor_voltage bad from 4.50 s to 8.50 s: disagrees"
    assert words[2] == "  motor_voltage saturated from 12.00 s to the end: at its limit"


def test_features_are_told_once_and_only_when_they_were_computed() -> None:
    value = r.FeatureValue(at(1), 1, 1, "std", at(0), at(1), 1.0, "", "+", 0, 1, "", 0.1)
    failed = replace(value, feature="rms", value=math.nan, reason="window missing")
    summary = summarise([scan(0.0), value, failed, value])
    assert summary["features_computed"] == ["std"]


class Threshold:
    """A stage: a current above 1 A is a jam, told when the input has ended."""

    consumes: tuple[type, ...] = (r.Scan,)

    def __init__(self) -> None:
        self._seen: list[r.Scan] = []

    def handle(self, record: r.Record) -> tuple[r.Record, ...]:
        if isinstance(record, r.Scan) and record.values[0] > 1.0 and not self._seen:
            self._seen.append(record)
            return (r.Detection(record.stamp_ns, 1, True, "motor_current", 2.0, 1.0, "z"),)
        return ()

    def finish(self) -> tuple[r.Record, ...]:
        return tuple(
            group((s.stamp_ns - START_NS) / SECOND, Outcome.ISOLATED, "jam") for s in self._seen
        )


def bag_of(directory: Path, *others: r.Record) -> Path:
    with BagWriter(directory, whole_every_s=None) as bag:
        for other in others:
            bag.write(other)
        for number in range(300):
            bag.write(scan(number / 100, 2.0 if number > 200 else 0.0))
    return directory


def test_a_bag_through_a_pipeline(tmp_path: Path) -> None:
    summary = replay(bag_of(tmp_path / "run"), Pipeline([Threshold()]))
    assert (summary["outcome"], summary["detected_at_s"]) == ("ISOLATED", 2.01)
    assert (summary["scans"], summary["duration_s"]) == (300, 2.99)
    assert summary["bag"] == str(tmp_path / "run")
    assert summary["backend"].startswith("numpy ")
    assert summary["recorded_digest"] is None
    assert summary["recorded_decision_digest"] is None
    assert json.loads(json.dumps(summary, allow_nan=False)) == summary


def test_truth_and_recorded_verdicts_reach_no_stage(tmp_path: Path) -> None:
    class Nosy(Threshold):
        consumes = (r.Scan, r.Truth, r.AmbiguityGroup, r.Detection)

        def handle(self, record: r.Record) -> tuple[r.Record, ...]:
            assert not isinstance(record, r.Truth)
            assert "spall" not in repr(record)
            return super().handle(record)

    live = group(1.0, Outcome.ISOLATED, "spall")
    bag = bag_of(tmp_path / "run", r.Truth(at(0), "jam", at(0)), live)
    summary = replay(bag, Pipeline([Nosy()]))
    assert summary["ambiguity_group"] == ["jam"]
    assert summary["recorded_digest"] == digest([live])
    assert summary["recorded_decision_digest"] == decision_digest([live])


def test_two_replays_are_equal(tmp_path: Path) -> None:
    bag = bag_of(tmp_path / "run")
    assert replay(bag, Pipeline([Threshold()])) == replay(bag, Pipeline([Threshold()]))


def test_a_bag_without_a_scan_is_refused(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "run") as bag:
        bag.write(r.Truth(at(0), "jam", at(0)))
    with pytest.raises(RecordingError, match=r"no scan \(topic sensors/slow\)"):
        replay(tmp_path / "run", Pipeline([Threshold()]))


@pytest.fixture
def shipped() -> None:
    try:
        for name in ("actuator.yaml", "feature_table.yaml", "calibration_simulated_stand.yaml"):
            config_path(name)
    except ConfigurationError as error:
        pytest.skip(f"the shipped configuration is not installed: {error}")


@pytest.mark.usefixtures("shipped")
def test_the_command_goes_on_past_bad_bags(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    good, short = bag_of(tmp_path / "good"), bag_of(tmp_path / "short")
    file = short / "short_0.mcap"
    file.write_bytes(file.read_bytes()[:-20])
    (tmp_path / "empty").mkdir()
    bags = [str(good), str(tmp_path / "empty"), str(short)]
    assert main(["replay", *bags, "--json", "-", "-q"]) == 1
    told = capsys.readouterr()
    summaries = json.loads(told.out)
    assert [each["bag"] for each in summaries] == [str(good), str(short)]
    assert told.err.splitlines()[-1] == "flea: 2 of 3 bags replayed, 1 refused, 1 incomplete"
    assert main(["replay", *bags, "--json", f"{tmp_path}/out/", "-q", "-j", "2"]) == 1
    assert capsys.readouterr().err == told.err
    results = [json.loads((tmp_path / "out" / f"{n}.json").read_text()) for n in ("good", "short")]
    assert results == summaries
    assert results[0]["digest"] == results[1]["digest"]
    assert results[0]["outcome"] is not None


@pytest.mark.usefixtures("shipped")
def test_what_was_interrupted_goes_on(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    bags = [str(bag_of(tmp_path / name)) for name in ("first", "second", "third")]
    out, replayed = tmp_path / "out", module.replay

    def once(bag: Path, *rest: Any) -> dict[str, Any]:
        if bag.name == "second":
            raise KeyboardInterrupt
        return replayed(bag, *rest)

    monkeypatch.setattr(module, "replay", once)
    command = ["replay", *bags, "--json", f"{out}/", "-q"]
    assert main(command) == 130
    assert [file.name for file in out.iterdir()] == ["first.json"]
    monkeypatch.setattr(module, "replay", replayed)
    first = out / "first.json"
    before = first.stat().st_mtime_ns
    assert main([*command, "--resume"]) == 0
    assert "1 of 3 bags are replayed already, 2 are left" in capsys.readouterr().err
    assert first.stat().st_mtime_ns == before
    assert sorted(file.name for file in out.iterdir()) == [
        "first.json",
        "second.json",
        "third.json",
    ]


@pytest.mark.usefixtures("shipped")
def test_results_that_would_differ_now_are_made_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bag, out = bag_of(tmp_path / "run"), tmp_path / "out"
    command = ["replay", str(bag), "--json", f"{out}/", "-q"]
    again = [*command, "--resume"]

    def left() -> str:
        capsys.readouterr()
        assert main(again) == 0
        return capsys.readouterr().err.splitlines()[0]

    assert main(command) == 0
    assert left() == "flea: 1 of 1 bags are replayed already, 0 are left"
    again += ["--configuration", "evidence"]
    assert left() == "flea: 0 of 1 bags are replayed already, 1 are left"
    assert left() == "flea: 1 of 1 bags are replayed already, 0 are left"
    file = out / "run.json"
    file.write_text(file.read_text()[:100])
    assert left() == "flea: 0 of 1 bags are replayed already, 1 are left"
    later = file.stat().st_mtime + 10.0
    os.utime(bag / "metadata.yaml", (later, later))
    assert left() == "flea: 0 of 1 bags are replayed already, 1 are left"
    assert main(["replay", str(bag), "-q", "--resume"]) == 2
    assert "give it by --json FOLDER/" in capsys.readouterr().err


def test_a_wrong_calibration_is_refused_before_any_bag(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    missing = tmp_path / "none.yaml"
    for jobs in ("1", "2"):
        bags = [str(tmp_path), str(tmp_path)]
        assert main(["replay", *bags, "--calibration", str(missing), "-j", jobs]) == 2
        told = capsys.readouterr().err
        assert "none.yaml" in told
        assert told.count("\n") == 1
