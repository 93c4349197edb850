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

"""The stand of Cranfield University from its CSV to verdicts, by what is shipped.

The full score, both halves and all conditions, is that of ``config/campaigns/cranfield.yaml``.
"""

from __future__ import annotations

import json
import re
import shlex
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.places import DATA, ROOT

from flea_diag.tools.main import main
from flea_diag.wire.bags.bag import read_bag
from flea_diag.wire.records import Scan

FOLDER = DATA / "cranfield"
PAGE = ROOT / "config" / "stands" / "cranfield" / "README.md"
COMMANDS = [shlex.split(line) for line in re.findall(r"^    flea (.+)", PAGE.read_text(), re.M)]
CONDITIONS = ("normal", "lackLubrication2")
LOADS = (20, 40, -40)
pytestmark = pytest.mark.skipif(not FOLDER.is_dir(), reason=f"no recordings in {FOLDER}")


@pytest.fixture(scope="module")
def bags(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("cranfield")
    files = [str(FOLDER / f"{name}.csv.gz") for name in CONDITIONS]
    assert main(["import", "--stand", "cranfield", *files, "-o", str(folder / "bags")]) == 0
    return folder / "bags"


def test_one_bag_a_test_in_si(bags: Path) -> None:
    names = {path.name for path in bags.iterdir()}
    tests = [f"{load}_{n}" for load in LOADS for n in (1, 3, 5, 7, 9)]
    assert names == {f"{condition}_{test}" for condition in CONDITIONS for test in tests}
    found = [r for _, r in read_bag(bags / "normal_40_3", (Scan,)) if isinstance(r, Scan)]
    assert {b.stamp_ns - a.stamp_ns for a, b in pairwise(found)} == {40_000_000}
    assert found[0].channels == ("motor_current", "actuator_position", "commanded_load")
    values = np.array([scan.values for scan in found])
    # README of the data: 0.683 A out and 1.109 A back at +40 kgf, which pulls the nut out.
    speed = np.gradient(values[:, 1], 0.04)
    out, back = values[speed > 0.02, 0].mean(), values[speed < -0.02, 0].mean()
    assert (out, back) == (pytest.approx(0.69, abs=0.02), pytest.approx(1.12, abs=0.02))
    assert set(values[:, 2]) == {-40.0 * 9.80665}


def test_half_of_the_normal_tests_calibrates_for_the_others(bags: Path, tmp_path: Path) -> None:
    normal = sorted(path for path in bags.iterdir() if path.name.startswith("normal"))
    calibration = str(tmp_path / "half.yaml")
    given = [str(path) for path in normal[::2]]
    assert main(["calibrate", *given, "--stand", "cranfield", "-o", calibration]) == 0
    lost = [bags / f"lackLubrication2_{load}_{n}" for load in (20, 40) for n in (1, 5, 9)]
    said = {bag.name: verdict(bag, calibration, tmp_path) for bag in [*normal[1::2], *lost]}
    assert sum(said[bag.name]["detected_at_s"] is not None for bag in normal[1::2]) <= 1
    groups = [said[bag.name]["ambiguity_group"] or [] for bag in lost]
    assert all("ball_nut_friction" in group and len(group) <= 3 for group in groups), groups


def verdict(bag: Path, calibration: str, tmp_path: Path) -> dict[str, Any]:
    path = tmp_path / f"{bag.name}.json"
    options = ["--stand", "cranfield", "--calibration", calibration, "--json", str(path)]
    assert main(["replay", str(bag), *options]) == 0
    said: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return said


def test_the_commands_of_its_page_lead_to_a_verdict(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("cranfield").symlink_to(FOLDER)
    assert len(COMMANDS) <= 4, "and no file is edited"
    for words in COMMANDS:
        files = [sorted(map(str, Path().glob(w))) if "*" in w else [w] for w in words]
        assert main([name for each in files for name in each]) == 0
    said = json.loads(Path("verdict.json").read_text(encoding="utf-8"))
    assert set(said["ambiguity_group"]) == {"backlash", "ball_nut_friction"}
    assert said["outcome"] == "INDISTINGUISHABLE"
