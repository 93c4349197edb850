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

"""A compile cache with damaged files is made anew, and that is said once."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from support.places import ROOT

pytest.importorskip("numba")

PROGRAM = """
import sys
from flea_diag.core.backend import exact
sys.path.insert(0, sys.argv[1])
from doubling import double
print(exact(double)(21.0))
"""


TWICE = """
import sys
from flea_diag.core.backend import exact
sys.path.insert(0, sys.argv[1])
from doubling import double
from halving import half
print(exact(double)(21.0), exact(half)(21.0))
"""


@pytest.mark.slow
def test_a_file_swapped_for_that_of_another_function_is_made_anew(tmp_path: Path) -> None:
    for name, body in (("doubling.py", "def double(x):\n    return 2.0 * x\n"),
                       ("halving.py", "def half(x):\n    return 0.5 * x\n")):  # fmt: skip
        (tmp_path / name).write_text(body)
        os.utime(tmp_path / name, (1, 1))
    assert run(TWICE, tmp_path).stdout == "42.0 10.5\n"
    one, other = (tmp_path / "cache").rglob("*.nbc")
    content = one.read_bytes()
    one.write_bytes(other.read_bytes())
    other.write_bytes(content)
    done = run(TWICE, tmp_path)
    assert (done.returncode, done.stdout) == (0, "42.0 10.5\n")
    assert done.stderr.count("damaged compile cache of ") == 2


def doubled(folder: Path) -> subprocess.CompletedProcess[str]:
    """A program that compiles one small function, with its cache in this folder."""
    (folder / "doubling.py").write_text("def double(x):\n    return 2.0 * x\n")
    os.utime(folder / "doubling.py", (1, 1))  # numba keeps the time of the source
    return run(PROGRAM, folder)


def run(program: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """A program with a cache of its own."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "NUMBA_CACHE_DIR": str(folder / "cache")}
    return subprocess.run(
        [sys.executable, "-c", program, str(folder)],
        env=environment, cwd=ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(
    ("ending", "content"), [("nbi", b""), ("nbi", b"\x80\x05K"), ("nbc", b"garbage")]
)
def test_a_damaged_file_is_made_anew(ending: str, content: bytes, tmp_path: Path) -> None:
    assert doubled(tmp_path).stdout == "42.0\n"
    (file,) = (tmp_path / "cache").rglob(f"*.{ending}")
    file.write_bytes(content)
    done = doubled(tmp_path)
    assert (done.returncode, done.stdout) == (0, "42.0\n")
    assert done.stderr.count("damaged compile cache of double, made anew") == 1
    assert file.read_bytes() != content
    again = doubled(tmp_path)
    assert (again.stdout, again.stderr) == ("42.0\n", "")
