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

"""The backend that a digest holds for."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest
from support.places import ROOT

from flea_diag.tools import numeric_backend

TWO_CORES = """\
processor\t: 0
vendor_id\t: GenuineIntel
cpu family\t: 6
model\t\t: 106
model name\t: a name that says less

processor\t: 1
vendor_id\t: AnotherVendor
cpu family\t: 9
model\t\t: 1
"""


def backend_with(description: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setattr(numeric_backend, "CPUINFO", description)
    return numeric_backend.numeric_backend()


def test_names_libraries_and_the_first_processor(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    description = tmp_path / "cpuinfo"
    description.write_text(TWO_CORES)
    told = backend_with(description, monkeypatch)
    assert told.startswith(f"numpy {version('numpy')}, scipy {version('scipy')}, ")
    assert told.endswith(", GenuineIntel 6 106")


@pytest.mark.skipif(platform.machine() != "x86_64", reason="the kernels named are of x86-64")
def test_other_kernels_of_blas_are_another_backend() -> None:
    program = "from flea_diag.tools.numeric_backend import *; print(numeric_backend())"
    told = {
        kernel: subprocess.run(
            [sys.executable, "-c", program],
            env={**os.environ, "OPENBLAS_CORETYPE": kernel, "PYTHONPATH": str(ROOT)},
            cwd=ROOT, capture_output=True, text=True, check=True,
        ).stdout
        for kernel in ("Sandybridge", "Nehalem")
    }  # fmt: skip
    for kernel, name in told.items():
        assert f"openblas {kernel}" in name


def test_instructions_chosen_by_hand_are_another_backend(monkeypatch: pytest.MonkeyPatch) -> None:
    before = numeric_backend.numeric_backend()
    monkeypatch.setenv("NUMBA_CPU_NAME", "gen\x1beric")
    told = numeric_backend.numeric_backend()
    assert r"NUMBA_CPU_NAME='gen\x1beric'" in told
    assert told.startswith(before.rpartition(", ")[0])


def test_instructions_that_numpy_may_not_use_are_another_backend() -> None:
    found = np.show_config(mode="dicts")["SIMD Extensions"]["found"]
    if not found:
        pytest.skip("numpy uses nothing beyond its baseline here")
    program = "from flea_diag.tools.numeric_backend import *; print(numeric_backend())"
    environment = {**os.environ, "NPY_DISABLE_CPU_FEATURES": found[-1], "PYTHONPATH": str(ROOT)}
    told = subprocess.run(
        [sys.executable, "-c", program],
        env=environment, cwd=ROOT, capture_output=True, text=True, check=True,
    ).stdout  # fmt: skip
    assert f" {found[-1]}," in numeric_backend.numeric_backend()
    assert f" {found[-1]}," not in told


@pytest.mark.parametrize("text", [None, "", "Hardware : of another kind\n"])
def test_a_system_without_such_a_description_still_has_a_name(
    text: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    description = tmp_path / "cpuinfo"
    if text is not None:
        description.write_text(text)
    assert backend_with(description, monkeypatch).rpartition(", ")[2]
