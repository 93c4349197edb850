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

"""`flea warm-up` in processes of its own, with a cache in which little is missing at first."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest
from support.decisions import BAGS
from support.places import ROOT

pytest.importorskip("numba")

from flea_diag.compile_cache import code_folder

WARM_UP = """
import sys
from flea_diag.tools.main import main
status = main(["warm-up", *sys.argv[2:]])

import numpy as np
from flea_diag.core.observers.particle_filter import ParticleFilter
from support.models.linear_actuator import START, model

filtered = ParticleFilter(
    model(), np.zeros(3), START, np.random.default_rng(0), particles=200, backend="numba"
)
draw = np.random.default_rng(2)
with open(sys.argv[1], "w") as file:
    for _ in range(100):
        filtered.predict(draw.normal(0.0, 3.0, len(model().inputs)))
        filtered.update(draw.normal(0.0, 0.5, len(model().channels)))
        file.write(filtered.mean.tobytes().hex())
sys.exit(status)
"""
"""The command, then estimates by loops of many parts, whose sums may be reordered.

They are compiled in this process, or have been found on disk."""
MISSING = ("run_windows.fading_loops", "channel_loops.last_loops")
"""What is compiled in no time. All else the tests have compiled already."""
REPLAY = (
    "import sys; from flea_diag.core.backend import compiling; "
    "from flea_diag.tools.main import main\n"
    "with compiling(lambda name: print('compiles', name)): main(sys.argv[1:])"
)


class Ran(NamedTuple):
    """A process that has ended, and the bits of the estimates that it wrote."""

    process: subprocess.CompletedProcess[str]
    estimates: str


@pytest.fixture(scope="module")
def folder(compiled: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("warm_up")
    there = folder / "cache/flea_diag"
    there.mkdir(mode=0o700, parents=True)
    for file in code_folder().iterdir():
        if not file.name.startswith((*MISSING, "particle_loops.")):
            shutil.copy2(file, there)
    return folder


def flea(folder: Path, *command: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", *command],
        env={
            **os.environ,
            "NUMBA_CACHE_DIR": str(folder / "cache"),
            "PYTHONPATH": f"{ROOT}:{ROOT / 'test'}",
        },
        capture_output=True,
        text=True,
    )


def warmed_up(folder: Path, *arguments: str) -> Ran:
    target = folder / "estimates"
    process = flea(folder, WARM_UP, str(target), *arguments)
    return Ran(process, target.read_text(encoding="ascii"))


@pytest.fixture(scope="module")
def cold(folder: Path) -> Ran:
    return warmed_up(folder, "--check", "--json", "-")


@pytest.fixture(scope="module")
def warm(cold: Ran, folder: Path) -> Ran:
    return warmed_up(folder, "--check")


@pytest.mark.in_turn(2)
def test_what_is_warmed_up_is_not_compiled_again(cold: Ran, warm: Ran, folder: Path) -> None:
    assert cold.process.returncode == 1
    assert "NUMBA_CACHE_DIR" in cold.process.stderr
    parts = {row["part"]: row["compiled"] for row in json.loads(cold.process.stdout)["parts"]}
    assert sorted(parts.pop("diagnosis")) == ["fading_loops", "last_loops"]
    assert parts == {"simulated stand": [], "replay": []}

    assert warm.process.returncode == 0, warm.process.stdout + warm.process.stderr
    assert "diagnosis: ready after" in warm.process.stdout
    assert "compiling" not in warm.process.stdout

    replay = flea(folder, REPLAY, "replay", str(BAGS / "jam"), "-q")
    assert (replay.returncode, replay.stdout) == (0, "")


@pytest.mark.in_turn(2)
def test_what_is_compiled_now_and_what_was_on_disk_give_the_same_bits(
    cold: Ran, warm: Ran, folder: Path
) -> None:
    assert list((folder / "cache/flea_diag").glob("particle_loops.*.nbc"))
    assert len(cold.estimates) > 1000
    assert warm.estimates == cold.estimates
