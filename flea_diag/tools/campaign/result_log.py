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

"""The results of an evaluation on disk: appended line by line, read back after any interruption."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from flea_diag.errors import ConfigurationError, RecordingError
from flea_diag.tools.campaign.run_result import RunResult, from_mapping
from flea_diag.wire.json_text import parse_json
from flea_diag.wire.regular_file import read_bytes, read_text

RESULTS = "results.jsonl"
PLAN = "plan.sha256"
LARGEST_BYTES = 256 << 20
LARGEST_NOTE_BYTES = 4096


class ResultLog:
    """Append results to the evaluation in a folder; a context manager.

    Parameters
    ----------
    folder
        Created if it does not exist.
    plan_sha256
        Digest of the campaign's plan.

    Attributes
    ----------
    done
        Results of earlier runs of the same plan, by key.

    Raises
    ------
    ConfigurationError
        The folder holds results of another plan, or cannot be written.
    """

    def __init__(self, folder: Path, plan_sha256: str) -> None:
        self.path = folder / RESULTS
        try:
            folder.mkdir(parents=True, exist_ok=True)
            _claim(folder, plan_sha256)
            if self.path.exists():
                _drop_half_a_line(self.path)
            kept = read_results(self.path) if self.path.exists() else ()
            self.done = {result.key: result for result in kept}
            self._file = self.path.open("a", encoding="utf-8")
        except OSError as error:
            raise ConfigurationError(f"cannot write {self.path}: {error.strerror}") from error

    def add(self, result: RunResult) -> None:
        """Append a result; it is flushed to the operating system."""
        self._file.write(result.to_line() + "\n")
        self._file.flush()
        self.done[result.key] = result

    def __enter__(self) -> ResultLog:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()


@contextmanager
def held(folder: Path) -> Iterator[None]:
    """Lock a folder: a second evaluation would make every run twice.

    Raises
    ------
    ConfigurationError
        Another process holds it, or it cannot be created.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(folder, os.O_RDONLY)
    except OSError as error:
        raise ConfigurationError(f"cannot write {folder}: {error.strerror}") from error
    try:
        _lock(descriptor, folder)
        yield
    finally:
        os.close(descriptor)


def _lock(descriptor: int, folder: Path) -> None:
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise ConfigurationError(
            f"{folder}: another evaluation is at work there: wait for its end, or choose another "
            "folder"
        ) from None


def read_results(path: Path) -> tuple[RunResult, ...]:
    """Runs of a file, or of the file in an evaluation's folder; of a repeated run the last line.

    Raises
    ------
    RecordingError
        There is none, or a line is no result.
    """
    file = path / RESULTS if path.is_dir() else path
    return tuple({result.key: result for result in _read(file)}.values())


def _read(file: Path) -> Iterator[RunResult]:
    try:
        text = read_text(file, LARGEST_BYTES)
    except OSError as error:
        raise RecordingError(f"{file}: cannot be read: {error}") from error
    whole = text[: text.rfind("\n") + 1]
    for number, line in enumerate(whole.splitlines(), 1):
        where = f"{file}: line {number}"
        try:
            content = parse_json(line)
        except ValueError as error:
            raise RecordingError(f"{where}: {error}") from None
        yield from_mapping(content, where)


def _claim(folder: Path, plan_sha256: str) -> None:
    """One folder, one plan."""
    note = folder / PLAN
    if note.exists() and _noted(note) != plan_sha256:
        raise ConfigurationError(
            f"{folder} holds the results of another campaign, or of this one as it was: choose "
            "another folder, or --force to start again"
        )
    note.write_text(plan_sha256 + "\n", encoding="utf-8")


def _noted(note: Path) -> str:
    try:
        return read_text(note, LARGEST_NOTE_BYTES, ConfigurationError).strip()
    except OSError as error:
        raise ConfigurationError(f"{note}: cannot be read: {error.strerror}") from error


def _drop_half_a_line(path: Path) -> None:
    """What a kill left of the last line goes; that run is made again."""
    content = read_bytes(path, LARGEST_BYTES, ConfigurationError)
    with path.open("rb+") as file:
        file.truncate(content.rfind(b"\n") + 1)
        os.fsync(file.fileno())
