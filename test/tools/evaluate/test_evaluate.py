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

"""A campaign by the command: every run a line, whatever stops it on the way."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
from itertools import islice
from pathlib import Path
from typing import Any

import pytest
import yaml
from support.decisions import BAGS, ROOT, expected
from support.evaluations import SHORT, case, until

from flea_diag.configuration.stand import load_stand
from flea_diag.tools import extra
from flea_diag.tools.campaign.result_log import RESULTS, ResultLog, held, read_results
from flea_diag.tools.campaign.run_result import RunResult
from flea_diag.tools.evaluate import case_run
from flea_diag.tools.evaluate.case_run import run_case
from flea_diag.tools.main import main
from flea_diag.wire.bags.bag import BagReader, BagWriter
from flea_diag.wire.records import ChannelTable, Scan

TRUTHS = {
    "jam": "jam",
    "live_motor_current_bias": "motor_current_bias",
    "motor_temperature_drift": "motor_temperature_drift",
    "nominal": "nominal",
    "unit_switch_jam": "jam",
    "winding_short": "winding_short",
}
"""Bag -> what was wrong with the stand."""


def written(folder: Path, **changes: Any) -> Path:
    path = folder / "short.yaml"
    path.write_text(yaml.safe_dump({**SHORT, **changes}), encoding="utf-8")
    return path


def command(campaign: Path, output: Path, *more: str) -> list[str]:
    arguments = ["evaluate", str(campaign), "-o", str(output), "-j", "1", *more]
    return [sys.executable, "-m", "flea_diag.tools.main", *arguments]


def lines(output: Path) -> list[str]:
    path = output / RESULTS
    return path.read_text(encoding="utf-8").splitlines() if path.exists() else []


@pytest.fixture(scope="module")
def evaluated(compiled: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The short campaign, killed in mid-run and ended by the same command."""
    folder = tmp_path_factory.mktemp("evaluated")
    campaign, output = written(folder), folder / "out"
    process = subprocess.Popen(command(campaign, output), start_new_session=True)
    until(lambda: len(lines(output)) >= 2, "two runs done")
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    kept = lines(output)
    with (output / RESULTS).open("a", encoding="utf-8") as file:
        file.write('{"id": "kept/nominal", "ki')
    subprocess.run(command(campaign, output, "-q"), check=False)
    assert lines(output)[: len(kept)] == kept
    return output


def test_every_run_has_one_line_after_a_kill(evaluated: Path) -> None:
    results = read_results(evaluated)
    assert sorted(result.id for result in results) == [f"kept/{name}" for name in TRUTHS]


def test_the_lines_say_what_the_replays_of_these_bags_are_kept_to_say(evaluated: Path) -> None:
    for result in read_results(evaluated):
        name = result.id.split("/")[1]
        kept = expected(name)
        assert result.truth == TRUTHS[name]
        assert list(result.group) == kept["ambiguity_group"]
        assert result.outcome == kept["outcome"]
        assert result.alarms_s == tuple(e["detected_at_s"] for e in kept["episodes"])
        assert result.kind == "simulated"
        assert result.cpu_s > 0.0
        assert result.peak_memory_bytes > 10e6


def test_times_count_from_the_onset_of_the_truth(evaluated: Path) -> None:
    (jam,) = (result for result in read_results(evaluated) if result.id == "kept/jam")
    assert jam.onset_s == 8.0
    assert jam.detection_time_s == pytest.approx(jam.alarms_s[0] - 8.0)
    assert jam.nominal_s == 8.0
    assert jam.detection_motion_s is not None
    assert jam.detection_motion_s <= jam.detection_time_s + 0.02
    assert jam.isolated_stamp_ns is not None
    assert jam.detected_stamp_ns is not None
    assert jam.isolated_stamp_ns - jam.detected_stamp_ns == pytest.approx(
        1e9 * ((jam.isolation_time_s or 0.0) - (jam.detection_time_s or 0.0))
    )


def test_the_summary_and_the_details_are_there(evaluated: Path) -> None:
    summary = json.loads((evaluated / "summary.json").read_text(encoding="utf-8"))
    assert summary["runs"] == 6
    (part,) = summary["parts"]
    right = sum(result.right for result in read_results(evaluated))
    assert part["scores"]["right"]["right"] == right
    # The switch has no vibration: there a jam and a failed lubrication stay one of two.
    reasons = {run["id"]: run["why"] for run in part["not_right"]}
    assert reasons["kept/unit_switch_jam"] == "group too large"
    for result in read_results(evaluated):
        detail = json.loads((evaluated / result.detail).read_text(encoding="utf-8"))
        assert detail["summary"]["digest"] == result.digest


def test_another_campaign_does_not_mix_in(
    evaluated: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = written(tmp_path, expect={"jam": ["jam", "spall"]})
    assert main(["evaluate", str(other), "-o", str(evaluated), "-q"]) == 2
    assert "holds the results of another campaign" in capsys.readouterr().err
    assert main(["evaluate", str(other), "-o", str(tmp_path), "-q", "--force"]) == 2
    assert "holds no evaluation" in capsys.readouterr().err


def test_another_calibration_does_not_mix_in(
    evaluated: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    same = written(tmp_path)
    other = ("--calibration", str(load_stand().calibration))
    assert main(["evaluate", str(same), "-o", str(evaluated), "-q", *other]) == 2
    assert "holds the results of another campaign" in capsys.readouterr().err


def test_a_run_that_failed_is_tried_again_and_its_last_line_counts(
    evaluated: Path, tmp_path: Path
) -> None:
    output = tmp_path / "again"
    shutil.copytree(evaluated, output)
    whole = read_results(output)
    (nominal,) = (r for r in whole if r.id == "kept/nominal")
    failed = RunResult(nominal.id, nominal.kind, nominal.row, failure="the disk was full")
    with (output / RESULTS).open("a", encoding="utf-8") as file:
        file.write(failed.to_line() + "\n")
    assert next(r for r in read_results(output) if r.id == nominal.id).failure
    assert main(["evaluate", str(written(evaluated.parent)), "-o", str(output), "-q"]) == 0
    again = {r.id: r.digest for r in read_results(output)}
    assert again == {r.id: r.digest for r in whole}


def test_a_folder_is_of_one_evaluation_at_a_time(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with held(tmp_path):
        assert main(["evaluate", str(written(tmp_path)), "-o", str(tmp_path), "-q"]) == 2
    assert "another evaluation is at work there" in capsys.readouterr().err
    with held(tmp_path):
        pass


def test_ctrl_c_keeps_what_is_done(compiled: None, tmp_path: Path) -> None:
    campaign, output = written(tmp_path), tmp_path / "out"
    process = subprocess.Popen(command(campaign, output), stderr=subprocess.PIPE, text=True)
    until(lambda: len(lines(output)) >= 1, "a run done")
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=30.0)
    assert process.returncode == 130
    kept = read_results(output)
    assert f"{len(kept)} of 6 runs are done" in errors
    assert "Traceback" not in errors
    summary = json.loads((output / "summary.json").read_text(encoding="utf-8"))
    assert summary["runs"] == len(kept) < 6


def test_a_run_that_fails_is_one_line_and_exit_1(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bags = tmp_path / "bags"
    for name in ("nominal", "winding_short"):
        shutil.copytree(BAGS / name, bags / name)
    (bags / "winding_short" / "winding_short_0.mcap").write_bytes(b"no bag at all")
    assert main(["evaluate", str(bags), "-o", str(tmp_path / "out"), "-j", "1"]) == 1
    results = {result.id: result for result in read_results(tmp_path / "out")}
    assert results["bags/nominal"].right
    assert "winding_short" in results["bags/winding_short"].failure
    assert "2 runs, 1 failed" in capsys.readouterr().out


def test_a_recording_without_its_truth_is_not_taken_for_healthy(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with BagWriter(tmp_path / "run") as bag:
        for record in islice(BagReader(BAGS / "nominal").records((ChannelTable, Scan)), 300):
            bag.write(record[1])
    out = tmp_path / "out"
    assert main(["evaluate", str(tmp_path / "run"), "-o", str(out), "-j", "1", "-q"]) == 1
    assert "flea: run/run: no truth, so it cannot be scored" in capsys.readouterr().err
    (line,) = read_results(out)
    assert not line.right


def test_a_defect_of_ours_is_one_line_that_names_the_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(case_run, "records", lambda _: [1 / 0])
    result = run_case(case("nominal"), {}, tmp_path)
    assert result.failure.startswith("ZeroDivisionError: division by zero (test_evaluate.py:")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["x.yaml"], "x.yaml: no such configuration file"),
        (["x.yaml", "-j", "0"], "-j 0: must be from 1 to 1024"),
    ],
)
def test_what_cannot_be_run_is_refused(
    arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["evaluate", *arguments]) == 2
    assert words in capsys.readouterr().err


def test_an_empty_folder_and_a_missing_package_are_said_before_any_work(
    tmp_path: Path,
    tmp_path_factory: pytest.TempPathFactory,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    empty = tmp_path_factory.mktemp("empty")  # of a short name: a quoted value has 80 characters
    assert main(["evaluate", str(empty), "-o", str(tmp_path / "out")]) == 2
    assert f"no recording matches '{empty}': no bag, no .data file" in capsys.readouterr().err
    monkeypatch.setattr(extra, "find_spec", lambda name: None)
    assert main(["evaluate", "small.yaml", "-o", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert "evaluate needs jinja2 and tqdm" in said
    assert f"{sys.executable} -m pip install 'Jinja2>=3.1' 'tqdm>=4.65'" in said
    assert not (tmp_path / "out").exists()


def test_every_extra_that_is_asked_for_is_one_that_can_be_installed() -> None:
    """Import names against the packages that setup.py lists under the extra."""
    text = (ROOT / "setup.py").read_text(encoding="utf-8").lower()
    for name, packages in extra.PACKAGES.items():
        listed = re.search(rf'"{name}": \[(.*?)\]', text, re.DOTALL)
        assert listed is not None, name
        for package in packages.values():
            assert f'"{package.lower()}>=' in listed[1], package


@pytest.mark.in_turn(2)
def test_the_shipped_small_campaign_loses_no_row(tmp_path: Path) -> None:
    assert main(["evaluate", "small.yaml", "-o", str(tmp_path / "out"), "-j", "2", "-q"]) == 0


def test_a_line_is_with_the_system_once_it_is_added(tmp_path: Path) -> None:
    with ResultLog(tmp_path, "plan") as log:
        log.add(RunResult("a", "real", "Nominal"))
        assert [result.id for result in read_results(tmp_path)] == ["a"]
    with ResultLog(tmp_path, "plan") as log:
        assert set(log.done) == {("a", "hybrid", "")}
