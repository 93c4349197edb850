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

"""Compiled code is kept by its content, and what is damaged is made anew, which is said once."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from support import in_turn
from support.places import ROOT

pytest.importorskip("numba")

from numba.core import config

from flea_diag import compile_cache
from flea_diag.core.backend import bound

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
    ("ending", "content"), in_turn([("nbi", b""), ("nbi", b"\x80\x05K"), ("nbc", b"garbage")], 3)
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


COPY = """
import sys
from flea_diag.core.backend import compiling, exact
sys.path.insert(0, sys.argv[1])
from doubling import double
with compiling(print):
    print(exact(double)(21.0))
"""


@pytest.mark.slow
def test_copies_of_a_source_share_what_is_compiled(tmp_path: Path) -> None:
    said = []
    for name in ("one", "two"):
        place = tmp_path / name
        place.mkdir()
        (place / "doubling.py").write_text("def double(x):\n    return 2.0 * x\n")
        (place / "cache").symlink_to(tmp_path)
        said.append(run(COPY, place).stdout)
    assert said == ["double\n42.0\n", "42.0\n"]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(config, "CACHE_DIR", "")
    monkeypatch.setenv("FLEA_CACHE_DIR", str(tmp_path / "cache"))
    return compile_cache.code_folder()


def offset(x: float) -> float:
    return x + STEP


def moved(x: float) -> float:
    return 2.0 * offset(x)


STEP = 1.0


def stand(step: float) -> Any:
    """The same function as generated for one stand."""
    part = bound(offset, STEP=step)
    return compile_cache.compiled(bound(moved, offset=part), (part,), {})


def loaded(function: Any) -> int:
    return sum(function.stats.cache_hits.values())


def test_what_differs_in_a_part_is_code_of_its_own(folder: Path) -> None:
    one, other = stand(1.0), stand(2.0)
    assert (one(1.0), other(1.0), loaded(one), loaded(other)) == (4.0, 6.0, 0, 0)
    again = stand(1.0), stand(2.0)
    assert [(each(1.0), loaded(each)) for each in again] == [(4.0, 1), (6.0, 1)]
    assert len(list(folder.glob("*.nbc"))) == 2
    assert folder.stat().st_mode & 0o777 == 0o700


def test_how_a_function_is_compiled_belongs_to_its_content(folder: Path) -> None:
    for options in ({"fastmath": {"nsz", "arcp"}}, {"error_model": "numpy"}):
        made = compile_cache.compiled(offset, (), options)
        assert (made(1.0), loaded(made)) == (2.0, 0)
    again = compile_cache.compiled(offset, (), {"fastmath": {"arcp", "nsz"}})
    assert (again(1.0), loaded(again)) == (2.0, 1)


class Pair(NamedTuple):
    first: float
    second: float


class Turned(NamedTuple):
    """As ``Pair`` is after a change of its source."""

    second: float
    first: float


Turned.__name__ = Turned.__qualname__ = "Pair"


def first_of(pair: Any) -> float:
    return pair.first


def test_fields_in_another_order_are_another_type(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    values = [1.0, 2.0]
    assert compile_cache.compiled(first_of, (), {})(Pair(*values)) == 1.0
    monkeypatch.setitem(globals(), "Pair", Turned)
    assert compile_cache.compiled(first_of, (), {})(Turned(*values)) == 2.0


@pytest.mark.parametrize("why", ["no folder", "open to others", "of another user"])
def test_a_folder_that_is_not_our_own_is_left_alone(
    why: str, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if why == "no folder":
        folder.parent.write_text("a file")
    else:
        folder.mkdir(parents=True)
        folder.chmod(0o777 if why == "open to others" else 0o700)
    if why == "of another user":
        monkeypatch.setattr(os, "geteuid", lambda: os.getuid() + 1)
    monkeypatch.setattr("numba.core.caching.InTreeCacheLocator.get_cache_path",
                        lambda _: str(tmp_path))  # fmt: skip
    made = stand(1.0)
    assert made(1.0) == 4.0
    assert not folder.is_dir() or not list(folder.iterdir())
    assert list(tmp_path.glob("*.nbc"))


def test_a_folder_that_can_keep_nothing_ends_no_work(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder.parent.write_text("a file")
    monkeypatch.setattr(compile_cache._ContentImpl, "_locator_classes", ())
    assert stand(1.0)(1.0) == 4.0


def test_what_nobody_has_loaded_for_long_is_deleted(folder: Path) -> None:
    for step in (1.0, 2.0):
        stand(step)(1.0)
    for index in folder.glob("*.nbi"):
        os.utime(index, (1, 1))
    assert loaded_after(1.0) == 1  # in use
    stand(3.0)(1.0)
    assert [loaded_after(step) for step in (1.0, 2.0, 3.0)] == [1, 0, 1]


def loaded_after(step: float) -> int:
    made = stand(step)
    made(1.0)
    return loaded(made)


def test_a_full_disk_ends_no_start(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: Any) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    made = stand(1.0)
    monkeypatch.setattr("numba.core.caching.IndexDataCacheFile.save", full)
    assert made(1.0) == 4.0
