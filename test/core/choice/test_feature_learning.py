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

"""Learning a table: from made-up features with known answers, from the stand, from bearings."""

from __future__ import annotations

import argparse
import math
import re
import shutil
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
import yaml
from support.places import DATA, FLEA_STAND

from flea_diag.core.choice.feature_learning import (
    SYMBOLS,
    Sample,
    learn,
    nearest,
    rank,
    select,
)
from flea_diag.core.choice.feature_table import FaultFeatureTable
from flea_diag.core.vibration.nominal_range import VibrationOperatingPoint
from flea_diag.errors import CalibrationError, ConfigurationError, RecordingError
from flea_diag.tools.features import bearing
from flea_diag.tools.features import features as tool
from flea_diag.tools.features.judge import Walk, report
from flea_diag.tools.features.samples import FeatureRun, Grid, label, run_of, run_of_bag
from flea_diag.tools.features.stand import drawn_scenario, stand_run
from flea_diag.wire.bags.bag import BagWriter
from flea_diag.wire.records import NEVER_NS, Scan, Truth, VibrationBlock
from flea_sim_driver.scenario.scenario_file import scenario_from_mapping
from flea_sim_driver.stand import SimulatedStand

POINT = VibrationOperatingPoint(80.0, 50.0)
STD, PEAK, CREST, TWIN = (
    f"accelerometer_2_{name}" for name in ("std", "peak", "crest", "shape_factor")
)


def made_up() -> list[Sample]:
    """``std`` sees both faults, ``peak`` the jam alone, ``crest`` nothing; a twin of ``std``."""
    draw = np.random.default_rng(0)
    shift = {"nominal": (0.0, 0.0), "jam": (3.0, 3.0), "spall": (9.0, 0.0)}
    samples = []
    for fault, (std, peak) in shift.items():
        for _ in range(100):
            value = std + 0.3 * draw.normal()
            values = {STD: value, PEAK: peak + 0.3 * draw.normal(), CREST: draw.normal(),
                      TWIN: value + 1e-3 * draw.normal()}  # fmt: skip
            samples.append(Sample(fault, POINT, {k: math.exp(v) for k, v in values.items()}))
    return samples


COSTS = {STD: 1.0, PEAK: 1.0, CREST: 1.0, TWIN: 1.1}


def distance(first: tuple[float, ...], second: tuple[float, ...]) -> float:
    """Bhattacharyya distance of two distributions, by its definition: 0 when they are equal."""
    return -math.log(np.sqrt(np.multiply(first, second)).sum())


def test_ranking_puts_what_tells_faults_apart_before_what_does_not() -> None:
    learned = learn(made_up(), list(COSTS), 0.02)
    scores = {score.feature: score for score in rank(learned, COSTS)}
    assert [score.feature for score in rank(learned, COSTS)][-1] == CREST
    assert scores[STD].auc == pytest.approx(1.0)
    assert scores[PEAK].auc == pytest.approx(0.75, abs=0.05)
    assert scores[CREST].auc == pytest.approx(0.5, abs=0.1)
    assert scores[STD].variance_ratio > 10.0 > scores[CREST].variance_ratio
    # Two faults, told apart perfectly: one bit.
    assert scores[PEAK].information_bit == pytest.approx(1.0, abs=0.1)
    assert scores[CREST].information_bit < 0.1


def test_selection_splits_all_pairs_without_twins_or_useless_features() -> None:
    learned = learn(made_up(), list(COSTS), 0.02)
    chosen = select(learned, COSTS, 4)
    assert CREST not in chosen
    assert len({STD, TWIN} & set(chosen)) == 1
    assert set(select(learned, COSTS, 1, kept=[CREST])) == {CREST}


def test_twins_are_named_with_their_correlation() -> None:
    learned = learn(made_up(), list(COSTS), 0.02)
    name, correlation = nearest(learned, TWIN, [STD, CREST])
    values = {f: np.concatenate(list(learned.deviations[f].values())) for f in (STD, TWIN)}
    wanted = np.corrcoef(*(np.tanh(values[f] / 3.0) for f in (STD, TWIN)))[0, 1]
    assert (name, correlation) == (STD, pytest.approx(abs(wanted)))
    assert nearest(learned, TWIN, [CREST])[1] < 0.2
    assert nearest(learned, TWIN, []) == ("", 0.0)


def test_little_and_much_are_told_apart() -> None:
    learned = learn(made_up(), [STD], 0.02)
    much = select(learned, COSTS, 1)[STD]
    jam, spall = (learned.probability(fault, STD, much) for fault in ("jam", "spall"))
    assert jam[SYMBOLS.index("+")] > 0.95
    assert spall[SYMBOLS.index("++")] > 0.95
    assert distance(jam, spall) > 1.5


def test_faults_that_both_stay_in_the_range_are_told_apart_inside_it() -> None:
    """Healthy units differ by more than these two faults do."""
    draw = np.random.default_rng(1)
    means = {"nominal": (0.0, 1.0), "jam": (1.3, 0.3), "ball_nut_friction": (-0.6, 0.3)}
    samples = [
        Sample(fault, POINT, {STD: math.exp(mean + scatter * draw.normal())})
        for fault, (mean, scatter) in means.items()
        for _ in range(200)
    ]
    learned = learn(samples, [STD], 0.01)
    ends = select(learned, COSTS, 1)[STD]
    jam, dry = (learned.probability(fault, STD, ends) for fault in ("jam", "ball_nut_friction"))
    assert jam[SYMBOLS.index("0^")] > 0.95
    assert dry[SYMBOLS.index("0")] > 0.95
    whole = (*ends[:2], 1.0)
    coarse = [learned.probability(f, STD, whole) for f in ("jam", "ball_nut_friction")]
    assert distance(*coarse) < 0.1 < 1.5 < distance(jam, dry)


def test_probabilities_are_counts_with_half_a_count_added() -> None:
    samples = made_up()
    found = learn(samples, [CREST], 0.02).probability("jam", CREST, (4.0, 4.0, 1.0))
    outside = 100 * (1.0 - found[2])
    assert sum(found) == pytest.approx(1.0)
    assert min(found) >= 0.5 / 103.0
    assert outside < 10.0


@pytest.mark.parametrize(
    ("speeds", "taken"),
    [((90.0, 60.0, 54.0, 20.0), (90.0, 60.0)), ((30.0, 25.0, 23.0, 16.0), (30.0, 25.0)),
     ((18.0, 14.0, 1.0), (18.0,)), ((1.0, math.nan), ())],
)  # fmt: skip
def test_features_are_asked_on_windows_that_are_fast_or_near_the_fastest(speeds, taken) -> None:
    samples = tuple(Sample("jam", VibrationOperatingPoint(speed, 50.0), {}) for speed in speeds)
    run = FeatureRun("made up", 1.0, samples)
    assert tuple(sample.point.speed_rad_s for sample in run.typical) == taken
    assert run.asked(["jam"], 9) == list(run.typical)


def test_features_are_asked_on_windows_in_motion_those_with_a_reversal_first() -> None:
    turning, straight = Sample("jam", POINT, {}), Sample("jam", POINT, {}, reverses=False)
    rest = Sample("jam", VibrationOperatingPoint(1.0, 50.0), {})
    run = FeatureRun("made up", 1.0, (rest, straight, turning, turning))
    assert run.asked(["jam"], 1) == [turning]
    assert run.asked(["jam"], 3) == [turning, turning, straight]
    assert FeatureRun("made up", 1.0, (rest, straight)).asked(["jam"], 3) == [straight]
    assert run.asked(["spall"], 3) == []


def test_table_needs_nominal_and_faulty_windows_in_motion() -> None:
    still = VibrationOperatingPoint(0.0, 0.0)
    resting = [Sample(s.fault, still, s.values) for s in made_up()]
    for samples in (made_up()[:100], made_up()[100:], resting, []):
        with pytest.raises(CalibrationError, match="a table needs both"):
            learn(samples, [STD], 0.02)


# --- labels ---------------------------------------------------------------------------------

S = 1_000_000_000


@pytest.mark.parametrize(
    ("truths", "expected"),
    [
        ([], "nominal"),
        ([Truth(0, "nominal", NEVER_NS), Truth(2 * S, "jam", 2 * S)], "jam"),
        ([Truth(7 * S, "jam", 7 * S)], "nominal"),
        ([Truth(5 * S, "jam", 5 * S)], None),
        ([Truth(2 * S, "jam", 2 * S, (("growth_s", "4.0"),))], None),
        ([Truth(S, "jam", S), Truth(3 * S, "nominal", NEVER_NS)], "nominal"),
        ([Truth(S, "jam", S), Truth(5 * S, "nominal", NEVER_NS)], None),
    ],
)
def test_window_is_labelled_only_when_the_truth_held_throughout(
    truths: list[Truth], expected: str | None
) -> None:
    assert label(truths, 4 * S, 6 * S) == expected


# --- the stand and bags ---------------------------------------------------------------------


def test_bag_gives_the_samples_that_the_stand_gives(tmp_path: Path) -> None:
    grid = Grid(0.5, 0.5, {"nut": 8.556})
    scenario = scenario_from_mapping(drawn_scenario(3, "jam", 1.6), "test")
    with BagWriter(tmp_path / "bag", whole_every_s=None) as bag:
        for record in SimulatedStand(scenario):
            bag.write(record, record.stamp_ns)
    direct, read = stand_run((3, "jam", 1.6), grid), run_of_bag(tmp_path / "bag", grid)
    assert len(direct.samples) == 2
    assert [s.fault for s in read.samples] == ["jam", "jam"]
    for one, other in zip(direct.samples, read.samples, strict=True):
        assert {k: v for k, v in one.values.items() if v == v} == {
            k: v for k, v in other.values.items() if v == v
        }


def test_levels_use_the_speed_that_the_monitor_uses() -> None:
    """One scan of 100 rad/s in the middle of a block, through a raised cosine of 31 scans."""
    blocks = [
        VibrationBlock.pack(
            k * S // 10, ("accelerometer_2_y",), np.arange(100) * 1_000_000, np.ones((100, 1))
        )
        for k in range(20)
    ]
    scans = [
        Scan(k * S // 100, ("motor_speed", "load_force"), (100.0 if k == 105 else 0.0, 50.0))
        for k in range(200)
    ]
    stream = sorted([*blocks, *scans], key=lambda record: record.stamp_ns)
    run = run_of("made up", stream, [], Grid(0.5, 0.5))
    smooth = [100.0 * (1.0 + math.cos(math.pi * j / 16.0)) / 32.0 for j in range(-5, 6)]
    fastest = max(point.speed_rad_s for point, _ in run.levels)
    assert fastest == pytest.approx(np.sqrt(np.mean(np.square(smooth))), rel=0.02)
    assert [point.load_n for point, _ in run.levels] == pytest.approx([50.0] * len(run.levels))


def command(*words: str) -> int:
    parser = argparse.ArgumentParser()
    tool.add_arguments(parser)
    return tool.run(parser.parse_args(words))


def stand_with_a_bearing(folder: Path) -> Path:
    """The FLEA with a bearing of published orders instead of its screw."""
    shutil.copytree(FLEA_STAND, folder)
    content = yaml.safe_load((folder / "stand.yaml").read_text())
    geometry = {"pitch_diameter_m": 39.04e-3, "ball_diameter_m": 7.94e-3, "balls": 9}
    content["kinematics"] = {"bearing": geometry}
    (folder / "stand.yaml").write_text(yaml.safe_dump(content))
    return folder


def bearing_orders() -> dict[str, float]:
    return {"bearing_outer": 3.5848, "bearing_inner": 5.4152, "bearing_ball": 4.7135}


@pytest.mark.in_turn(3)
@pytest.mark.slow
def test_learn_judge_and_tree_on_a_small_draw(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "table.yaml"
    draw = ["--duration", "3.4", "--window", "0.5", "--hop", "0.5"]
    stand = str(stand_with_a_bearing(tmp_path / "mine"))
    given = ["--stand", stand, "--most", "8", "-o", str(path)]
    assert command("learn", "--seeds", "0:3", *draw, *given) == 0
    told = capsys.readouterr().err
    assert re.search(r"resting_levels: \d+ healthy runs with 6 blocks at rest, 20 are needed", told)
    assert "accelerometer_2_gear_mesh_line: the kinematics of the stand do not give this" in told
    text = path.read_text()
    assert text.startswith("# learned fault feature table. Made by")
    table = FaultFeatureTable.from_mapping(yaml.safe_load(text), "table")
    assert {"spall", "jam", "accelerometer_2_fault", "motor_current_bias"} <= set(table.faults)
    assert not any(fault.startswith("motor_speed") for fault in table.faults)
    assert table.nominal.window_s == 0.5
    assert table.nominal.orders == pytest.approx(bearing_orders(), abs=3e-3)
    assert table.nominal.rate_hz == 20_000.0
    capsys.readouterr()
    group, windows = "spall,accelerometer_2_fault,accelerometer_1_fault", ["--windows", "3"]
    assert command("judge", str(path), "--seeds", "50:53", *draw, "--group", group, *windows) == 0
    row = capsys.readouterr().out.splitlines()[-1].split()
    assert (row[0], row[1]) == ("all", "9")
    assert float(row[2]) >= 7 / 9 - 1e-3
    picture, classifier = tmp_path / "tree.svg", tmp_path / "classifier.json"
    pair = ["jam", "accelerometer_1_fault"]
    assert command("tree", str(path), *pair, "--draw", str(picture)) == 0
    said = capsys.readouterr().out
    assert "{accelerometer_1_fault}" in said
    for word in ("accelerometer_1_fault", said.split("?")[0]):
        assert word in picture.read_text()
    assert command("train", "--seeds", "0:1", *draw, "-o", str(classifier)) == 0
    judged = ["--seeds", "50:51", *draw, "--group", ",".join(pair), "--pairs"]
    assert command("judge", str(path), *judged, "--classifier", str(classifier)) == 0
    said = capsys.readouterr().out
    assert "jam | accelerometer_1_fault" in said
    assert "right" in said


def test_lists_and_measures_every_feature(capsys: pytest.CaptureFixture[str]) -> None:
    assert command("list") == 0
    assert "accelerometer_<n>_std" in capsys.readouterr().out


def test_bad_arguments_are_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="give bags"):
        command("learn", "-o", str(tmp_path / "t.yaml"))
    with pytest.raises(ConfigurationError, match="--seeds = '3'"):
        command("learn", "--seeds", "3", "-o", str(tmp_path / "t.yaml"))
    for loads in ("3", "200:100", "0:400", "a:b", "nan:nan"):
        with pytest.raises(ConfigurationError, match="--loads"):
            command("judge", "feature_table.yaml", "--seeds", "0:1", "--loads", loads)
    with pytest.raises(ConfigurationError, match="must end in one of"):
        command("tree", "feature_table_paper.yaml", "--draw", str(tmp_path / "tree.doc"))
    with pytest.raises(ConfigurationError, match="--rarest"):
        command("tree", "feature_table_paper.yaml", "--rarest", "1")
    with pytest.raises(ConfigurationError, match=r"paper\.yaml: fault 'rust' is unknown"):
        command("judge", "feature_table_paper.yaml", "--seeds", "0:1", "--group", "jam,rust")
    for option, value in (("--hop", "0"), ("--window", "-1"), ("--jobs", "0"), ("--most", "x")):
        with pytest.raises(SystemExit):  # of argparse: the same as for a number that is none
            command("learn", "-o", str(tmp_path / "t.yaml"), "--seeds", "0:1", option, value)
    with pytest.raises(ConfigurationError, match="study: fault 'rust' is unknown"):
        command("study", "--seeds", "0:1", "--faults", "rust")
    with pytest.raises(ConfigurationError, match="no such"):
        command("tree", str(tmp_path / "absent.yaml"))


def test_report_counts_what_was_resolved_and_kept() -> None:
    walks = [
        Walk("jam", ("jam",), ("a",), 1.0),
        Walk("jam", ("jam", "spall"), ("a", "b"), 3.0),
        Walk("spall", ("jam",), ("a",), 2.0),
    ]
    jam, spall, everything = (line.split() for line in report(walks).splitlines()[1:])
    assert (jam[0], jam[1], jam[2]) == ("jam", "2", "0.500")
    assert (spall[0], spall[2]) == ("spall", "0.000")
    assert everything[-1] == "2.00"


# --- real bearings --------------------------------------------------------------------------

FILES = {
    "normal": "normal_0_97.mat",
    "inner": "48k_Drive_End_IR007_0_109.mat",
    "outer": "48k_Drive_End_OR021@6_0_238.mat",
    "ball": "48k_Drive_End_B021_0_226.mat",
}


@pytest.fixture(scope="module")
def recordings() -> dict[str, bearing.BearingRecording]:
    if not all((DATA / "cwru" / file).is_file() for file in FILES.values()):
        pytest.skip(f"no bearing recordings in {DATA / 'cwru'}: set FLEA_DATA_DIR")
    return {
        name: bearing.read_bearing(DATA / "cwru" / file, 48_000.0, 1797.0)
        for name, file in FILES.items()
    }


def test_real_spalls_are_detected_in_windows_of_a_tenth_of_a_second(
    recordings: dict[str, bearing.BearingRecording],
) -> None:
    normal, *faulty = recordings.values()
    found = {row.feature: row for row in bearing.judge(normal, faulty, 0.1, 0.01)}
    for name in ("std", "rms", "peak", "band_500_1500_rms"):
        row = found[f"accelerometer_1_{name}"]
        assert row.false_alarms <= 0.05
        assert min(row.detected.values()) == 1.0
    # Kurtosis misses half of the ball fault, as is known of these recordings.
    kurtosis = found["accelerometer_1_kurtosis"].detected
    assert list(kurtosis.values())[:2] == [1.0, 1.0]
    assert kurtosis[FILES["ball"].removesuffix(".mat")] < 0.8


def test_envelope_names_the_race_of_real_spalls(
    recordings: dict[str, bearing.BearingRecording],
) -> None:
    lines = {name: Counter(bearing.lines(recording)) for name, recording in recordings.items()}
    assert set(lines["inner"]) == {"inner"}
    assert set(lines["outer"]) == {"outer"}
    assert set(lines["normal"]) == {"unclassified"}
    assert "outer" not in lines["ball"]


def test_lines_of_the_bearing_stand_where_they_were_published() -> None:
    shaft_hz = 1797.0 / 60.0
    orders = bearing.SKF_6205.orders()
    assert orders["outer"] * shaft_hz == pytest.approx(107.4, abs=0.2)
    assert orders["inner"] * shaft_hz == pytest.approx(162.2, abs=0.2)


def test_foreign_file_is_refused_by_name(tmp_path: Path) -> None:
    path = tmp_path / "foreign.mat"
    path.write_bytes(b"not a MATLAB file at all" * 20)
    with pytest.raises(RecordingError, match=r"foreign\.mat"):
        bearing.read_bearing(path, 48_000.0, 1797.0)
    with pytest.raises(RecordingError, match=r"absent\.mat"):
        bearing.read_bearing(tmp_path / "absent.mat", 48_000.0, 1797.0)
