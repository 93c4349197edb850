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

"""``flea calibrate`` from bags on disk: what it writes, draws and says, and what it refuses."""

from __future__ import annotations

import hashlib
import json
import math
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from support import stands
from support.models import linear_ema as ema
from support.places import FLEA_STAND, WING

from flea_diag.configuration import knowledge as of_stand
from flea_diag.configuration.calibrations import load_calibration
from flea_diag.configuration.description import compiled_relations
from flea_diag.core.calibration.nominal_trace import Trace
from flea_diag.core.residuals.channel_units import UNITS
from flea_diag.tools import extra
from flea_diag.tools.calibrate import plots as calibration_plots
from flea_diag.tools.calibrate import report
from flea_diag.tools.calibrate.calibrate import write_calibration
from flea_diag.tools.calibrate.nominal_recording import read_nominal
from flea_diag.tools.calibrate.shared_work import Sharing
from flea_diag.tools.main import main
from flea_diag.tools.terminal import IN_PART
from flea_diag.wire.bags.bag import BagWriter
from flea_diag.wire.records import NEVER_NS, ChannelInfo, ChannelTable, Scan, Truth

FLEA = compiled_relations("actuator.yaml").residuals

PERIOD_NS = 10_000_000
FLEA_CHANNELS = (*ema.STAND,)


def bag(
    path: Path,
    columns,
    *,
    stand: str = "bench 1",
    units: dict[str, str] | None = None,
    channels: tuple[str, ...] = FLEA_CHANNELS,
    period_ns: int = PERIOD_NS,
    sampling: str = "mean",
    fault: str = "",
    with_table: bool = True,
) -> Path:
    """A recording of these columns; a channel that they lack reads 1."""
    values = {c: columns.get(c, np.ones(len(columns["motor_current"]))) for c in channels}
    unit = {**UNITS, **(units or {})}
    infos = tuple(
        ChannelInfo(
            c,
            unit.get(c, "1"),
            -1e4,
            1e4,
            100.0,
            sampling=sampling if c == "motor_voltage" else "instant",
        )
        for c in channels
    )
    with BagWriter(path) as writer:
        if with_table:
            writer.write(ChannelTable(0, stand, infos), 0)
        if fault:
            writer.write(Truth(0, fault, NEVER_NS), 0)
        for k, row in enumerate(zip(*values.values(), strict=True)):
            stamp = (k + 1) * period_ns
            writer.write(Scan(stamp, channels, tuple(map(float, row))), stamp)
    return path


@pytest.fixture(scope="module")
def bags(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("bags")
    return [bag(folder / f"run_{n}", columns) for n, columns in enumerate(ema.nominal_runs())]


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Two short ones, for what does not depend on how much they teach."""
    folder, runs = tmp_path_factory.mktemp("two"), ema.nominal_runs()[:2]
    cut = [{name: values[:1200] for name, values in columns.items()} for columns in runs]
    return [bag(folder / f"short_{n}", columns) for n, columns in enumerate(cut)]


@pytest.fixture(scope="module")
def made(bags: list[Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    target = tmp_path_factory.mktemp("made") / "calibration.yaml"
    arguments = ["--plots", str(target.parent / "pictures"), "--plot-format", "svg"]
    assert main(["calibrate", *map(str, bags), "-o", str(target), *arguments]) == 0
    return target


@pytest.mark.in_turn(2)
def test_the_file_names_its_bags_and_holds_what_the_same_runs_teach_directly(made, bags):
    calibration = load_calibration(made)
    assert calibration.sources == tuple(path.name for path in bags)
    direct = stands.calibration()
    for name in ("winding_resistance_ohm", "coulomb_friction_n", "motor_heating_k_per_a2s"):
        assert getattr(calibration.parameters, name) == getattr(direct.parameters, name)
    assert calibration.limits == direct.limits


def test_two_processes_read_what_one_reads(bags, tmp_path):
    given = [*bags[:2], tmp_path, bags[0]]
    (here, why), (there, why_there) = (read_nominal(given, FLEA, Sharing(jobs)) for jobs in (1, 2))
    assert why_there == why
    assert ["is not a bag" in why[0], "is given twice" in why[1], len(why)] == [True, True, 2]
    for one, other in zip(here, there, strict=True):
        np.testing.assert_array_equal(other.run.rows, one.run.rows)
        assert replace(other, run=one.run) == one


def test_every_parameter_has_a_covariance_or_the_reason_why_not(made):
    calibration = load_calibration(made)
    fitted = [name for block in calibration.covariance for name in block.parameters]
    assert sorted([*fitted, *calibration.not_identified]) == sorted(
        type(calibration.parameters).__dataclass_fields__
    )
    for block in calibration.covariance:
        matrix = np.array(block.matrix)
        np.testing.assert_allclose(matrix, matrix.T, rtol=1e-9)
        scale = np.sqrt(np.diag(matrix))
        assert (np.linalg.eigvalsh(matrix / np.outer(scale, scale)) > -1e-9).all()
        for name, sigma in zip(block.parameters, scale, strict=True):
            assert calibration.sigmas[name] == pytest.approx(sigma)


def test_a_picture_of_each_recording_shows_each_residual_within_its_limits(made, bags):
    pictures = sorted((made.parent / "pictures").glob("*.svg"))
    assert [picture.stem for picture in pictures] == ["envelope", *sorted(b.name for b in bags)]
    pictures = pictures[1:]
    text = pictures[0].read_text(encoding="utf-8")
    assert text.count("<svg") == 1
    assert text.count('id="axes_') >= len(
        [limit for limit in load_calibration(made).limits if limit.windows[0].window > 1]
    )


def test_heat_is_said_and_drawn_beside_the_rest_of_the_envelope(made):
    found = load_calibration(made)
    relations = of_stand.relations(stands.STAND, found)
    stores = found.envelope.supplies  # the ambient air has no supply
    assert set(stores) == {"motor_temperature", "nut_temperature"}
    said = report.words(found, relations)
    for name in stores:
        assert f"{name}: supplied with up to {stores[name]:.3g}" in said
    picture = (made.parent / "pictures" / "envelope.svg").read_text(encoding="utf-8")
    assert picture.count("mean supply") == len(stores)


def test_what_is_drawn_is_the_mean_that_is_tested(made):
    """Against plain loops over one residual of one recording."""
    calibration = load_calibration(made)
    limit = calibration.limit("parity_electrical_dn")
    window = limit.windows[1]
    draw = np.random.default_rng(3)
    values = np.full((400, len(FLEA.rows)), np.nan)
    column = FLEA.place["parity_electrical_dn"]
    values[:, column] = draw.standard_normal(400)
    values[50:60, column] = np.nan
    moving = np.arange(400) % 7 > 0
    trace = Trace("x", FLEA, values, np.full(400, 0.04), moving, np.ones(400, dtype=bool))
    mean, low, high = calibration_plots.windowed(limit, window, trace)
    held: list[float] = []
    for k in range(400):
        tested = moving[k] and math.isfinite(values[k, column])
        held += [values[k, column]] if tested else []
        if tested and len(held) >= window.window:
            assert mean[k] == pytest.approx(np.mean(held[-window.window :]))
            reach = window.k * window.sigma[1]
            assert (low[k], high[k]) == pytest.approx(
                (window.centre[1] - reach, window.centre[1] + reach)
            )
        else:
            assert math.isnan(mean[k])


def still() -> dict:
    columns = ema.noisy(ema.run(seconds=8.0), 5)
    return {name: np.full_like(column, column[0]) for name, column in columns.items()}


def moved(seconds: float = 8.0) -> dict:
    return ema.noisy(ema.run(seconds=seconds), 6)


REFUSED = {
    "one recording": ([{}], "1 usable recordings, at least 2 are needed"),
    "no motion": (
        [{"columns": still()}, {"columns": still()}],
        "0.0 s of motion .* record the actuator while it moves",
    ),
    "another stand": ([{}, {"stand": "bench 2"}], "on stand 'bench 2', .* on 'bench 1'"),
    "another sampling": ([{}, {"sampling": "instant_pwm"}], "sampled as 'instant_pwm'"),
    "another period": ([{}, {"period_ns": 20_000_000}], "scans every 0.02 s"),
    "another set of channels": (
        [{}, {"channels": FLEA_CHANNELS[:-1]}],
        "channel ambient_temperature is missing here or in run_0",
    ),
    "a fault in it": ([{}, {"fault": "jam"}], "truth is 'jam': calibration needs nominal"),
    "a wrong unit": ([{}, {"units": {"motor_current": "mA"}}], "motor_current is in 'mA'"),
    "no channel table": ([{}, {"with_table": False}], "no channel table"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_bags_that_cannot_serve_are_refused_with_reason_and_remedy(case, tmp_path, capsys):
    made, words = REFUSED[case]
    paths = []
    for number, given in enumerate(made):
        options = dict(given)
        columns = options.pop("columns", None) or moved()
        paths.append(bag(tmp_path / f"run_{number}", columns, **options))
    target = tmp_path / "calibration.yaml"
    status = main(["calibrate", *map(str, paths), "-o", str(target)])
    told = capsys.readouterr().err
    assert status != 0
    assert "Traceback" not in told
    assert re.search(words, told), told
    assert not target.exists()


def test_a_bag_that_cannot_serve_is_left_out_and_words_and_status_say_so(two, tmp_path, capsys):
    jammed = bag(tmp_path / "jammed", moved(), fault="jam")
    target = tmp_path / "calibration.yaml"
    arguments = ["calibrate", str(jammed), *map(str, two), "-o", str(target)]
    assert main(arguments) == 1
    words, told = capsys.readouterr()
    assert "1 of 3 bags not used" in told
    assert words.startswith("2 nominal recordings, ")
    for said in ("winding_resistance_ohm", "L/R is far below", "strongly correlated", "limits for"):
        assert said in words
    assert load_calibration(target).sources == tuple(path.name for path in two)
    assert main(arguments) == 2
    assert "exists: use --force" in capsys.readouterr().err


def test_bags_of_another_actuator_than_described_are_refused(two, tmp_path, capsys):
    target = tmp_path / "calibration.yaml"
    arguments = [*map(str, two), "-o", str(target), "--actuator", str(WING)]
    assert main(["calibrate", *arguments]) == 2
    told = capsys.readouterr().err
    assert "is not a sensor of actuator" in told
    assert "--actuator" in told
    assert not target.exists()


@pytest.mark.in_turn(2)
def test_a_recording_with_a_fault_in_it_is_named_and_left_out(bags, tmp_path, capsys):
    drag = ema.run(ema.HEALTHY, 24.0, faulty=ema.changed(coulomb=200.0), onset_s=12.0)
    odd, target = bag(tmp_path / "dragging", ema.noisy(drag, 9)), tmp_path / "out.yaml"
    sound = bags[:4]  # enough to tell who is odd
    assert main(["calibrate", *map(str, sound), str(odd), "-o", str(target)]) == IN_PART
    told = capsys.readouterr()
    assert re.search(
        r"dragging: left out: \w+, mean of \d+ reaches [\d.]+ times the limit", told.err
    )
    calibration = load_calibration(target)
    assert [row.recording for row in calibration.left_out] == ["dragging"]
    assert calibration.sources == tuple(path.name for path in sound)
    assert calibration.out_of_sample.recordings == len(sound)
    assert calibration.promise.alarms == calibration.out_of_sample.alarms == 0
    assert "judged without themselves, 4 recordings reach at most" in told.out


def test_a_calibration_says_which_description_it_was_made_with(made):
    content = yaml.safe_load((FLEA_STAND / "actuator.yaml").read_text(encoding="utf-8"))
    del content["schema_version"]
    line = json.dumps(content, sort_keys=True, separators=(",", ":"))
    assert load_calibration(made).actuator_sha256 == hashlib.sha256(line.encode()).hexdigest()


def test_a_stand_of_your_own_is_calibrated_into_its_folder(two, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    shutil.copytree(FLEA_STAND, tmp_path / "mine")
    described = tmp_path / "mine" / "actuator.yaml"
    text = described.read_text(encoding="utf-8")
    described.write_text(text.replace("description: DC motor", "description: my motor"))
    target = "mine/calibration_simulated_stand.yaml"
    given = [*map(str, two), "--stand", "./mine", "-o", target, "--force"]
    equations = ["model", "equations", "--stand", "./mine", "--calibration", target]
    assert main(equations) == 2
    capsys.readouterr()
    assert main(["calibrate", *given, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["sources"] == [path.name for path in two]
    assert main(equations) == 0
    capsys.readouterr()
    assert main(["model", "equations", "--calibration", target]) == 2
    said = capsys.readouterr().err
    assert f"flea: {target}: made for actuator 'flea' (sha256 " in said
    assert said.endswith(f": calibrate again with flea calibrate --stand {FLEA_STAND}\n")


def test_a_bag_counts_once_however_often_it_is_given(bags, tmp_path, capsys):
    again = bags[0].parent / "." / ".." / bags[0].parent.name / bags[0].name
    assert main(["calibrate", str(bags[0]), str(again), "-o", str(tmp_path / "c.yaml")]) == 2
    said = capsys.readouterr().err
    assert "is given twice" in said
    assert "1 usable recordings, at least 2 are needed" in said


def test_a_rate_of_no_false_alarms_is_refused(bags, tmp_path, capsys):
    target = str(tmp_path / "c.yaml")
    assert main(["calibrate", str(bags[0]), "-o", target, "--false-alarms", "0"]) == 2
    assert "must be above 0 per hour" in capsys.readouterr().err


def test_pictures_without_matplotlib_are_refused_before_any_work(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(extra, "find_spec", lambda name: None)
    arguments = ["nothing", "-o", str(tmp_path / "c.yaml"), "--plots", str(tmp_path)]
    assert main(["calibrate", *arguments]) == 2
    assert "-m pip install 'matplotlib>=3.7'" in capsys.readouterr().err


def test_units_are_checked_for_every_channel_that_is_read():
    assert set(UNITS) == set(FLEA.channels)


def test_a_serial_number_that_changes_within_a_bag_is_none(tmp_path, capsys):
    columns = {name: values[:50] for name, values in next(iter(ema.nominal_runs())).items()}
    with BagWriter(tmp_path / "switched") as writer:
        for serial in "AB":
            rows = tuple(replace(row, serial=serial) for row in stands.table().channels)
            writer.write(replace(stands.table(), channels=rows), stands.START_NS)
        for scan in stands.scans(columns):
            writer.write(scan, scan.stamp_ns)
    (recording,), refused = read_nominal([tmp_path / "switched"], FLEA)
    assert (recording.serial, refused) == ("", [])
    assert "the serial number changes from 'A' to 'B'" in capsys.readouterr().err


def test_a_law_alone_is_learned_into_an_older_calibration(made, bags, tmp_path, capsys):
    known, older = load_calibration(made), tmp_path / "older.yaml"
    write_calibration(older, replace(known, law=None))
    arguments = ["calibrate", *map(str, bags), "--law-only", "-o"]
    assert main([*arguments, str(tmp_path / "missing.yaml")]) == 2
    assert "does not exist" in capsys.readouterr().err
    assert main([*arguments, str(older)]) == 0
    assert load_calibration(older).to_mapping() == known.to_mapping()
