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

"""Files of every version are read or refused by their version, in one line.

``formats`` beside this file holds what earlier releases wrote, shortened; the number in a name is
the version that such a file counts as.
"""

from __future__ import annotations

import gzip
import json
import sqlite3
from collections.abc import Callable
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml
from support.places import CONFIG, FLEA_STAND, ROOT

from flea_diag.configuration.calibrations import learned, load_calibration
from flea_diag.configuration.files import load_yaml
from flea_diag.configuration.knowledge import load_features, relations
from flea_diag.configuration.stand import load_stand
from flea_diag.core.bond_graph.actuator import Actuator, actuator
from flea_diag.core.choice.classifier import Perceptron
from flea_diag.core.choice.feature_table import FaultFeatureTable
from flea_diag.core.faults.effect_row import UNBOUNDED
from flea_diag.core.faults.fault import catalogue
from flea_diag.core.faults.response import UNSTATED
from flea_diag.errors import CalibrationError, ConfigurationError, InputError, RecordingError
from flea_diag.formats import FORMATS, KEY, migrated, stamped
from flea_diag.nodes.operator.alarm_journal import AlarmJournal
from flea_diag.tools.campaign.campaign import load_campaign
from flea_diag.tools.campaign.result_log import read_results
from flea_diag.tools.campaign.run_trace import RunTrace, read_trace, trace_path, write_trace
from flea_diag.tools.features.classifier import read_classifier
from flea_diag.tools.score.decision import read_decisions
from flea_diag.wire.bags.bag_reader import BagReader
from flea_sim_driver.scenario.scenario_file import load_scenario

OLD = Path(__file__).with_name("formats")
BAG = ROOT / "bags" / "live_motor_current_bias"
"""Recorded before feature tables had a version; its attachments are files of that time."""

BOMB: list[Any] = ["x"]
for _ in range(60):
    BOMB = [BOMB] * 9


# --- versions ---------------------------------------------------------------------------------

REFUSED: dict[str, tuple[Callable[[int, int], object], str]] = {
    "newer": (lambda oldest, current: current + 1, "made by a newer flea_diag, update this one"),
    "far newer": (lambda oldest, current: 10**6000, "made by a newer flea_diag"),
    "older": (lambda oldest, current: oldest - 1, "this flea_diag reads"),
    "far older": (lambda oldest, current: -(10**6000), "this flea_diag reads"),
    "nothing": (lambda oldest, current: None, "must be a whole number"),
    "truth value": (lambda oldest, current: True, "= True, it must be a whole number"),
    "number with a point": (lambda oldest, current: float(current), "must be a whole number"),
    "not a number": (lambda oldest, current: float("nan"), "= nan, it must be a whole number"),
    "text": (lambda oldest, current: str(current), "must be a whole number"),
    "text with escapes": (lambda oldest, current: "\x1b[2J\u202e", r"= '\x1b[2J\u202e', it must"),
    "list": (lambda oldest, current: [current], "must be a whole number"),
    "mapping": (lambda oldest, current: {"major": current}, "must be a whole number"),
    "bomb": (lambda oldest, current: BOMB, "..., it must be a whole number"),
}


@pytest.mark.parametrize("wrong", REFUSED)
@pytest.mark.parametrize("kind", FORMATS)
def test_another_version_is_refused_in_one_line(kind: str, wrong: str) -> None:
    version, words = REFUSED[wrong]
    known = FORMATS[kind]
    content = {KEY: version(known.oldest, known.version)}
    with pytest.raises(known.error) as refusal:
        migrated(kind, content, "file.yaml")
    text = str(refusal.value)
    assert text.startswith(f"file.yaml: {kind} has schema_version = ")
    assert words in text
    assert text.isprintable()
    assert len(text) < 300


@pytest.mark.parametrize("kind", FORMATS)
def test_a_file_without_a_version_counts_as_the_first_that_had_none(kind: str) -> None:
    if FORMATS[kind].unversioned is not None:
        assert migrated(kind, {"a": 1}, "x") == {"a": 1}
        return
    with pytest.raises(FORMATS[kind].error, match=f"^file.yaml: {kind} has no schema_version"):
        migrated(kind, {"a": 1}, "file.yaml")


@pytest.mark.parametrize("content", [None, [], ["x"], "text", 5, BOMB])
@pytest.mark.parametrize("kind", FORMATS)
def test_what_is_no_mapping_is_refused(kind: str, content: object) -> None:
    with pytest.raises(FORMATS[kind].error, match=f"^x: {kind} must be a mapping, not .{{1,80}}$"):
        migrated(kind, content, "x")


@pytest.mark.parametrize("kind", FORMATS)
def test_steps_lead_to_the_current_version_without_a_gap(kind: str) -> None:
    known = FORMATS[kind]
    assert sorted(known.steps) == list(range(known.oldest, known.version))
    assert known.unversioned in (None, known.oldest)


@pytest.mark.parametrize("kind", FORMATS)
def test_what_is_written_now_is_read_as_it_is(kind: str) -> None:
    content = {"b": [1, {"c": "0+"}], "a": None}
    assert list(stamped(kind, content)) == [KEY, "b", "a"]
    assert migrated(kind, stamped(kind, content), "x") == content


def test_who_refuses_what() -> None:
    """A command says of a calibration, of configuration and of results what each of them is."""
    by_error: dict[type[InputError], set[str]] = {}
    for kind, known in FORMATS.items():
        by_error.setdefault(known.error, set()).add(kind)
    assert by_error[CalibrationError] == {"calibration"}
    assert {"feature table", "scenario", "campaign"} <= by_error[ConfigurationError]
    assert {"run result", "replay summary"} <= by_error[RecordingError]


# --- files of each kind, by their readers -----------------------------------------------------


def described(path: Path) -> Actuator:
    return actuator(load_yaml(path), str(path))


def faults(path: Path) -> object:
    return catalogue(load_yaml(path), actuator(load_yaml("actuator.yaml")), str(path))


READERS: dict[str, tuple[Callable[[Path], object], Path]] = {
    "stand": (lambda path: load_stand(path.parent), FLEA_STAND / "stand.yaml"),
    "actuator description": (described, FLEA_STAND / "actuator.yaml"),
    "fault catalogue": (faults, FLEA_STAND / "faults.yaml"),
    "feature table": (lambda path: load_features(str(path)), OLD / "feature_table_0.yaml"),
    "calibration": (load_calibration, OLD / "calibration_1.yaml"),
    "classifier": (read_classifier, OLD / "classifier_1.json"),
    "scenario": (load_scenario, OLD / "scenario_0.yaml"),
    "campaign": (load_campaign, CONFIG / "campaigns" / "small.yaml"),
    "run result": (read_results, OLD / "evaluation_1" / "results.jsonl"),
    "replay summary": (read_decisions, OLD / "replay_1.json"),
}


@pytest.mark.parametrize("kind", READERS)
def test_every_reader_reads_the_old_and_refuses_the_newer(kind: str, tmp_path: Path) -> None:
    read, old = READERS[kind]
    assert read(old)
    newer = tmp_path / old.name
    content = yaml.safe_load(old.read_text(encoding="utf-8"))  # JSON too
    newer.write_text(json.dumps({**content, KEY: FORMATS[kind].version + 1}) + "\n")
    with pytest.raises(FORMATS[kind].error, match="made by a newer flea_diag") as refusal:
        read(newer)
    assert str(refusal.value).startswith(str(newer))


FOREIGN = ("diagnostic_aggregator.yaml", "domain_bridge.yaml", "ros2_medkit_thresholds.yaml")
"""Parameters of other programs."""
SHIPPED = [str(path.relative_to(CONFIG)) for path in sorted(CONFIG.rglob("*.yaml"))]


@pytest.mark.parametrize("name", [name for name in SHIPPED if name not in FOREIGN])
def test_every_file_that_is_shipped_has_its_version(name: str) -> None:
    known = 2 if Path(name).stem.startswith("calibration") else 1
    assert yaml.safe_load((CONFIG / name).read_text(encoding="utf-8"))[KEY] in range(1, known + 1)


def test_a_feature_table_of_the_time_of_0_plus_says_the_same_in_todays_words(
    tmp_path: Path,
) -> None:
    old = OLD / "feature_table_0.yaml"
    today = tmp_path / "today.yaml"
    today.write_text("schema_version: 1\n" + old.read_text("utf-8").replace("0+", "0^"))
    read, expected = load_features(str(old)), load_features(str(today))
    assert read == expected
    assert read.alphabet == ("--", "-", "0", "0^", "+", "++")
    upper = read.place("0^")
    assert read.probabilities("jam", "accelerometer_1_std")[upper] == pytest.approx(0.169)
    assert read.probabilities("winding_open", "accelerometer_2_crest")[upper] == pytest.approx(
        0.509
    )


@pytest.mark.parametrize(
    "content",
    [
        {"alphabet": ["0+"], "faults": 5, "unaffected": [1]},
        {"alphabet": ["0+"], "faults": {"jam": {"crest": ["0+"]}}},
        {"alphabet": "0+"},
        {"alphabet": {"0+": 1}},
        {},
    ],
)
def test_a_step_leaves_alone_what_it_does_not_know(content: dict[str, Any]) -> None:
    before = deepcopy(content)
    migrated("feature table", content, "x")
    assert content == before
    with pytest.raises(ConfigurationError, match=r"^x"):
        FaultFeatureTable.from_mapping(content, "x")


def test_attachments_of_an_old_bag_say_what_the_shipped_files_say(tmp_path: Path) -> None:
    for name, text in BagReader(BAG).attachments.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    # Neither the digest of the description, nor the envelope, nor the law was known, nor for how
    # long a voltage may be held, nor how often a window misleads.
    shipped = learned(load_stand())
    tested = tuple(limit for limit in shipped.sensors if limit.channel != "motor_voltage")
    shipped = replace(shipped, actuator_sha256="", envelope=None, sensors=tested, law=None)
    assert load_calibration(tmp_path / "calibration.yaml") == shipped
    assert KEY not in load_yaml(tmp_path / "features.yaml")
    table = load_features(str(tmp_path / "features.yaml"))
    assert table == replace(load_features("feature_table.yaml"), window_error={})
    old, shipped = described(tmp_path / "actuator.yaml"), described(FLEA_STAND / "actuator.yaml")
    assert old.graph.bonds == shipped.graph.bonds
    assert {s.channel: s.at for s in old.sensors.values()} == {
        s.channel: s.at for s in shipped.sensors.values()
    }
    # Faults name parameters of the graph: more of them are drawn now, none has gone.
    before, after = old.graph.values(), shipped.graph.values()
    # But the width of the friction is that which calibrations have held all along.
    assert after.pop("friction_smooth_speed") * after["screw_ratio"] == pytest.approx(0.004)
    assert before.pop("friction_smooth_speed") == 3.0
    assert before.items() <= after.items()
    # Nor did a catalogue say how large a fault is, what else would, or what people do about it.
    before_then = {"effects": (), "errors": UNBOUNDED, "response": UNSTATED, "impacts": None,
                   "sized_by": ""}  # fmt: skip
    old_faults, now = faults(tmp_path / "faults.yaml"), faults(FLEA_STAND / "faults.yaml")
    # A connector of too much resistance has been a fault since.
    unsized = {n: replace(row, **before_then) for n, row in now.items() if n in old_faults}
    assert set(now) - set(old_faults) == {"winding_resistance_rise", "supply_sag"}
    assert {n: replace(row, response=UNSTATED) for n, row in old_faults.items()} == unsized


def test_a_description_from_before_base_parameters_is_refused_with_a_calibration(
    tmp_path: Path,
) -> None:
    path = tmp_path / "actuator.yaml"
    path.write_text(BagReader(BAG).attachments["actuator.yaml"], encoding="utf-8")
    with pytest.raises(ConfigurationError, match=r"no relation holds .* under base_parameters"):
        relations(load_stand(actuator=path), learned(load_stand()))


def test_an_old_evaluation_keeps_its_evidence(tmp_path: Path) -> None:
    (decision,) = read_decisions(OLD / "evaluation_1").values()
    assert decision.outcome == "ISOLATED"
    assert decision.group == ("jam",)
    (episode,) = decision.episodes
    assert episode.detected_at_s == 8.31
    place = tmp_path / "runs" / "hybrid" / "in.jam.json"
    place.parent.mkdir(parents=True)
    old = OLD / "evaluation_1"
    (tmp_path / "results.jsonl").write_bytes((old / "results.jsonl").read_bytes())
    detail = json.loads((old / "runs" / "hybrid" / "in.jam.json").read_text("utf-8"))
    for changes, words in (
        ({KEY: 2}, "run detail has schema_version = 2"),
        ({"summary": {**detail["summary"], KEY: 2}}, "replay summary has schema_version = 2"),
    ):
        place.write_text(json.dumps({**detail, **changes}), encoding="utf-8")
        with pytest.raises(RecordingError, match=words):
            read_decisions(tmp_path)


def test_a_trace_of_another_version_is_not_drawn(tmp_path: Path) -> None:
    detail = tmp_path / "run.json"
    write_trace(detail, RunTrace())
    content = json.loads(gzip.decompress(trace_path(detail).read_bytes()))
    assert content[KEY] == 1
    assert read_trace(detail) is not None
    for version in (0, 2, True, "1"):
        trace_path(detail).write_bytes(
            gzip.compress(json.dumps({**content, KEY: version}).encode())
        )
        assert read_trace(detail) is None


OLD_JOURNAL = """
CREATE TABLE alarm (
    stand TEXT NOT NULL, source TEXT NOT NULL, detected_ns INTEGER NOT NULL,
    record TEXT NOT NULL, acknowledged_ns INTEGER NOT NULL DEFAULT -1,
    acknowledged_by TEXT NOT NULL DEFAULT '', PRIMARY KEY (stand, source, detected_ns));
CREATE TABLE comment (
    stand TEXT NOT NULL, source TEXT NOT NULL, detected_ns INTEGER NOT NULL,
    stamp_ns INTEGER NOT NULL, author TEXT NOT NULL, text TEXT NOT NULL);
INSERT INTO comment VALUES ('stand', 'mark', -1, 5, 'Ada', 'load changed');
"""


def test_a_journal_without_a_version_is_taken_over_and_a_newer_one_left_alone(
    tmp_path: Path,
) -> None:
    path = tmp_path / "alarms.sqlite"
    with sqlite3.connect(path) as old:
        old.executescript(OLD_JOURNAL)
    taken = AlarmJournal(path)
    assert [mark.text for mark in taken.marks()] == ["load changed"]
    taken.close()
    with sqlite3.connect(path) as known:
        assert known.execute("PRAGMA user_version").fetchone() == (1,)
        known.execute("PRAGMA user_version = 2")
    with pytest.raises(ConfigurationError, match="alarm journal has schema_version = 2, this flea"):
        AlarmJournal(path)


def test_a_network_is_refused_by_its_version_before_its_keys() -> None:
    with pytest.raises(ConfigurationError, match="classifier has schema_version = 2"):
        Perceptron.from_mapping({KEY: 2, "weights": []}, "c.json")


def test_a_result_says_its_version(tmp_path: Path) -> None:
    (result,) = read_results(OLD / "evaluation_1")
    assert json.loads(replace(result, fold="A").to_line())[KEY] == 1
