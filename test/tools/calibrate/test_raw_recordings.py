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

"""Calibration and check of a stand straight from raw recordings: the same as from their bags."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from flea_diag.tools.main import main


def joint_csv(path: Path, seed: int, rows: int = 1500) -> Path:
    """A geared joint with friction and inertia, at 100 Hz."""
    rng = np.random.default_rng(seed)
    t = 0.01 * np.arange(rows)
    q = 2.5 + 1.8 * np.sin(0.6 * t + seed) + 0.3 * np.sin(1.9 * t)
    v, a = np.gradient(q, 0.01), np.gradient(np.gradient(q, 0.01), 0.01)
    i = 0.8 * np.tanh(v / 0.05) + v + 0.14 * a + rng.normal(0.0, 0.03, rows)
    columns = [t, i, 80.0 * v + rng.normal(0.0, 0.3, rows), q + rng.normal(0.0, 1e-4, rows)]
    head = "time_s,elbow_current_A,elbow_velocity_rad_s,elbow_position_rad"
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=head, comments="", fmt="%.7g")
    return path


@pytest.fixture(scope="module")
def stand(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("raw")
    for seed in (1, 2):
        joint_csv(folder / f"healthy_{seed}.csv", seed)
    found = folder / "mine"
    assert main(["stand", "new", str(found), "--from", str(folder / "healthy_1.csv")]) == 0
    return found


@pytest.fixture(scope="module")
def calibration(stand: Path) -> Path:
    files = [str(stand.parent / f"healthy_{seed}.csv") for seed in (1, 2)]
    raw = stand.parent / "raw.yaml"
    assert main(["calibrate", *files, "--stand", str(stand), "-o", str(raw)]) == 0
    return raw


def test_a_calibration_of_raw_files_is_that_of_their_bags(
    stand: Path, calibration: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files = [str(stand.parent / f"healthy_{seed}.csv") for seed in (1, 2)]
    bagged = stand.parent / "bagged.yaml"
    bags = stand.parent / "bags"
    assert main(["import", "--stand", str(stand), *files, "-o", str(bags)]) == 0
    places = [str(bags / f"healthy_{seed}") for seed in (1, 2)]
    assert main(["calibrate", *places, "--stand", str(stand), "-o", str(bagged)]) == 0
    assert calibration.read_text(encoding="utf-8") == bagged.read_text(encoding="utf-8")
    capsys.readouterr()
    assert main(["stand", "check", str(stand), *files]) == 0
    assert "Stand mine: 2 recordings" in capsys.readouterr().out
    assert summaries(stand, files, calibration) == summaries(stand, places, calibration)


def summaries(stand: Path, recordings: list[str], calibration: Path) -> list[object]:
    """What ``flea replay`` says of recordings, but for their places."""
    told = stand.parent / "told.json"
    given = ["--stand", str(stand), "--calibration", str(calibration), "--json", str(told)]
    assert main(["replay", *recordings, "-q", *given]) == 0
    said = json.loads(told.read_text(encoding="utf-8"))
    assert [each.pop("bag") for each in said] == recordings
    return list(said)


def test_a_raw_recording_that_is_refused_stops_no_other(
    stand: Path, calibration: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files = [str(stand.parent / "healthy_1.csv"), str(stand.parent / "no.csv")]
    Path(files[1]).write_text("time_s,current\n0,1\n", encoding="utf-8")
    given = ["--stand", str(stand), "--calibration", str(calibration)]
    assert main(["replay", *files, *given]) == 1
    found = capsys.readouterr()
    assert found.out.startswith(f"{files[0]}: ")
    assert "no.csv" in found.err
    assert "1 of 2 bags replayed, 1 refused" in found.err


def test_a_recording_given_under_two_names_counts_once(
    stand: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = stand.parent / "healthy_1.csv"
    again = stand.parent / "copied.csv"
    again.write_bytes(file.read_bytes())
    output = stand.parent / "twice.yaml"
    assert main(["calibrate", str(file), str(again), "--stand", str(stand), "-o", str(output)]) == 2
    errors = capsys.readouterr().err
    assert "copied holds the same readings as healthy_1" in errors
    assert "1 usable recordings, at least 2 are needed" in errors
