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

"""Every command that writes, and what it writes, for a disk whose n-th operation fails."""

from __future__ import annotations

import contextlib
import io
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from mcap.exceptions import McapError
from mcap.reader import make_reader

from flea_diag.tools.main import main
from support.disk.failing_disk import FULL, FailingDisk
from support.places import ROOT

BAG = ROOT / "bags" / "jam"
OLD = "what was there before\n"


@dataclass(frozen=True)
class Writing:
    """One command; ``argv`` takes the folder that it writes to, ``replaces`` a file that is old."""

    argv: Callable[[Path], list[str]]
    replaces: str = ""
    slow: bool = False
    makes: Callable[[Path], None] = lambda folder: None
    """What must be there before."""
    resumes: bool = False
    """Whether it goes on with what an earlier run has left."""


def _flea_text(folder: Path) -> None:
    """A recording of a tenth of a second in the text of the FLEA."""
    from tools.recordings.test_importer import line, write

    write(folder / "in", [line(number) for number in range(10)])


def _cut(folder: Path) -> None:
    """A bag that lacks its end."""
    (folder / "in").mkdir()
    whole = (ROOT / "bags" / "nominal" / "nominal_0.mcap").read_bytes()
    (folder / "in" / "cut_0.mcap").write_bytes(whole[: len(whole) // 3])


def _joint(folder: Path) -> None:
    """Two short tables of a joint, and a stand that was made of one of them."""
    from tools.calibrate.test_raw_recordings import joint_csv

    (folder / "in").mkdir()
    files = [joint_csv(folder / "in" / f"run_{seed}.csv", seed, 900) for seed in (1, 2)]
    with contextlib.redirect_stdout(io.StringIO()):
        assert main(["stand", "new", str(folder / "in" / "mine"), "--from", str(files[0])]) == 0


def _recordings(folder: Path) -> None:
    """A folder of one bag."""
    shutil.copytree(BAG, folder / "in" / "jam")


def _in(folder: Path) -> str:
    return str(next((folder / "in").iterdir()))


WRITING: dict[str, Writing] = {
    "simulate": Writing(
        lambda f: ["simulate", "nominal", "--duration", "1", "--no-vibration", "-o", str(f / "out")]
    ),
    "simulate --json": Writing(
        lambda f: ["simulate", "nominal", "--duration", "1", "-o", str(f / "out"), "--json",
                   str(f / "told.json")], "told.json"
    ),
    "import": Writing(
        lambda f: ["import", _in(f), "-o", str(f / "out")], makes=_flea_text
    ),
    "import --force": Writing(
        lambda f: ["import", _in(f), "-o", str(f / "out"), "--force"], makes=_flea_text
    ),
    "recover": Writing(lambda f: ["recover", _in(f), "-o", str(f / "out")], makes=_cut),
    "events": Writing(lambda f: ["events", str(BAG), "-o", str(f / "out")]),
    "report": Writing(lambda f: ["report", str(BAG), "-o", str(f / "page.html")], "page.html"),
    "export csv": Writing(
        lambda f: ["export", str(BAG), "-o", str(f / "table.csv"), "--force"], "table.csv"
    ),
    "export csv.gz": Writing(
        lambda f: ["export", str(BAG), "-o", str(f / "table.csv.gz"), "--force"], "table.csv.gz"
    ),
    "export parquet": Writing(
        lambda f: ["export", str(BAG), "-o", str(f / "table.parquet"), "--force"], "table.parquet"
    ),
    "export scn": Writing(
        lambda f: ["export", str(BAG), "-o", str(f / "table.scn"), "--force"], "table.scn"
    ),
    "export bag": Writing(lambda f: ["export", str(BAG), "-o", str(f / "out")]),
    "replay --json": Writing(
        lambda f: ["replay", str(BAG), "--json", str(f / "told.json")], "told.json", slow=True
    ),
    "calibrate": Writing(
        lambda f: ["calibrate", *(str(f / "in" / f"run_{k}.csv") for k in (1, 2)), "--stand",
                   str(f / "in" / "mine"), "-o", str(f / "out.yaml"), "--force", "--json",
                   str(f / "told.json")],
        "out.yaml", slow=True, makes=_joint
    ),
    "evaluate": Writing(
        lambda f: ["evaluate", str(f / "in"), "-o", str(f / "out"), "-j", "1", "-q"],
        slow=True, makes=_recordings, resumes=True
    ),
    "stand new": Writing(
        lambda f: ["stand", "new", str(f / "out"), "--from", str(BAG)], slow=True
    ),
    "scenarios": Writing(lambda f: ["scenarios", "table4", "-o", str(f / "out")], slow=True),
    "model --json": Writing(
        lambda f: ["model", "signatures", "--json", str(f / "told.json")], "told.json"
    ),
}  # fmt: skip


@dataclass(frozen=True)
class Failed:
    """One command with one operation that failed."""

    name: str
    number: int
    operation: str
    wrong: str = ""


def operations(name: str, folder: Path) -> tuple[int, dict[str, bytes]]:
    """How many operations a command has on its disk, and what is there in the end."""
    disk, status, told = _run(name, folder, 0)
    assert status == 0, told
    return disk.count, _held(folder)


def failed(name: str, number: int, folder: Path, whole: dict[str, bytes]) -> Failed:
    """Have the n-th operation of a command fail; ``whole`` is what it writes otherwise."""
    disk, status, told = _run(name, folder, number)
    operation = disk.failed[0].replace(str(folder), "") if disk.failed else "none"
    if WRITING[name].resumes:
        return Failed(name, number, operation, _resumed(name, folder, status, told, whole))
    return Failed(name, number, operation, _wrong(name, folder, status, told, whole))


def _resumed(name: str, folder: Path, status: int, told: str, whole: dict[str, bytes]) -> str:
    """What is wrong with one line of words, or with the same command on a disk that works.

    Its files hold times of computing, so no two runs write the same.
    """
    if status:
        if not 1 <= len(told.strip().splitlines()) <= 2:
            return f"not one line: {told!r}"
        _, status, told = _again(name, folder, 0)
    if status or _held(folder).keys() != whole.keys():
        return f"does not go on: exit {status}, {told!r}, {sorted(_held(folder))}"
    return ""


def _run(name: str, folder: Path, number: int) -> tuple[FailingDisk, int, str]:
    row = WRITING[name]
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    row.makes(folder)
    if row.replaces:
        (folder / row.replaces).write_text(OLD)
    return _again(name, folder, number)


def _again(name: str, folder: Path, number: int) -> tuple[FailingDisk, int, str]:
    """The command on what is there."""
    row = WRITING[name]
    disk = FailingDisk(folder, lambda count, _name: FULL if count == number else 0)
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), disk.in_use():
        try:
            status = main(row.argv(folder))
        except Exception as error:  # what a user would see as a traceback
            status, told = -1, f"{type(error).__name__}: {error}"
            return disk, status, told
    return disk, status, err.getvalue()


def _wrong(name: str, folder: Path, status: int, told: str, whole: dict[str, bytes]) -> str:
    """What is not as it must be: the words, or the files that are left."""
    if status == -1:
        return f"traceback: {told}"
    if status == 0 and _held(folder).keys() != whole.keys():
        return f"exit 0, and {sorted(whole.keys() ^ _held(folder).keys())} differ"
    if status not in (0, 1, 2):
        return f"exit {status}"
    lines = told.strip().splitlines()
    if status and not 1 <= len(lines) <= 2:
        return f"{len(lines)} lines: {told!r}"
    halves = (_half(folder, path, whole) for path in _files(folder))
    return "; ".join(filter(None, (*halves, _part(name, folder, whole) if status else "")))


def _part(name: str, folder: Path, whole: dict[str, bytes]) -> str:
    """Whether some files of a folder are there and others are not; empty: all, or none."""
    made = {file for file in whole if file.startswith("out/")}
    found = made & _held(folder).keys()
    return f"{len(found)} of {len(made)} files" if found and found != made else ""


def _half(folder: Path, path: Path, whole: dict[str, bytes]) -> str:
    """Why a file is a half-written one; empty: it is old, or whole."""
    name = str(path.relative_to(folder))
    content = path.read_bytes()
    if name.startswith("in/") or content == OLD.encode():
        return ""
    if name not in whole:
        return f"{name} is left behind"
    if path.suffix == ".mcap":
        return _unreadable(path, name)
    return "" if len(content) == len(whole[name]) else f"{name} is cut: {len(content)} bytes"


def _unreadable(path: Path, name: str) -> str:
    try:
        with path.open("rb") as stream:
            count = sum(1 for _ in make_reader(stream).iter_messages(log_time_order=False))
    except McapError as error:
        return f"{name} cannot be read: {error}"
    return "" if count and (path.parent / "metadata.yaml").exists() else f"{name} holds nothing"


def _files(folder: Path) -> list[Path]:
    return sorted(path for path in folder.rglob("*") if path.is_file())


def _held(folder: Path) -> dict[str, bytes]:
    """Every file by its name."""
    return {str(p.relative_to(folder)): p.read_bytes() for p in _files(folder)}
