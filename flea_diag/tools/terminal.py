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

"""Messages on the terminal and writing of files, common to all commands."""

from __future__ import annotations

import json
import math
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TextIO

from flea_diag.errors import ConfigurationError, line_of, visible
from flea_diag.wire.whole_file import replace_file

IN_PART = 1
"""Exit status of a batch of which a part was refused or lost."""


def say(text: object = "", *, end: str = "\n", file: TextIO | None = None) -> None:
    """Print text, on standard output by default, with its control characters escaped."""
    print(visible(str(text)), end=end, file=file, flush=file is not None)


def warn(words: str) -> None:
    """Print a line on standard error, after clearing a progress line."""
    clear = "\r\x1b[K" if sys.stderr.isatty() else ""
    print(f"{clear}flea: {line_of(words)}", file=sys.stderr)


def progress(number: int, count: int, name: str, began_s: float | None = None) -> None:
    """Show the progress of a batch, on a terminal only.

    ``began_s``: reading of ``time.monotonic`` when the first one began; the time left is then
    that of the others at the mean rate so far.
    """
    if sys.stderr.isatty():
        end = "\n" if number == count else ""
        left = "" if began_s is None else _left(time.monotonic() - began_s, number - 1, count)
        line = f"[{number}/{count}{left}] {line_of(name)}"
        print(f"\r\x1b[K{line}", end=end, file=sys.stderr, flush=True)


def fetched(name: str, size_bytes: int) -> None:
    """Show how much of a file has been fetched, on a terminal only."""
    if sys.stderr.isatty():
        line = f"{line_of(name)}: {size_bytes / 1e6:.0f} MB"
        print(f"\r\x1b[K{line}", end="", file=sys.stderr, flush=True)


def _left(spent_s: float, done: int, count: int) -> str:
    """Time left in words, once one is done."""
    if not done:
        return ""
    left_s = round(spent_s / done * (count - done))
    return f", {left_s // 60} min {left_s % 60} s left" if left_s >= 60 else f", {left_s} s left"


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Convert an OSError while writing a file or folder to a one-line error that names it.

    Raises
    ------
    ConfigurationError
        For every OSError.
    """
    try:
        yield
    except OSError as error:
        raise ConfigurationError(f"{path}: cannot be written: {error.strerror or error}") from error


def write_text(path: Path, text: str) -> None:
    """Replace a file atomically: a reader sees either the old or the new content.

    Raises
    ------
    ConfigurationError
        The file cannot be written.
    """
    with writing(path):
        replace_file(path, text.encode())


def write_json(target: str, content: Any) -> None:
    """Write JSON to a file, or to standard output for ``-``; what is not finite becomes null.

    Raises
    ------
    ConfigurationError
        The file cannot be written.
    """
    text = json.dumps(_finite(content), indent=2, allow_nan=False) + "\n"
    if target == "-":
        sys.stdout.write(text)
    else:
        write_text(Path(target), text)


def _finite(value: Any) -> Any:
    """The same with null for NaN and infinity, which JSON does not have."""
    if isinstance(value, dict):
        return {key: _finite(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def tell(target: str | None, content: Any, words: str) -> None:
    """Print the words, or what they say as JSON where ``--json`` asks for it.

    ``target``: None, ``-`` for JSON alone, or a file for the JSON besides the words.

    Raises
    ------
    ConfigurationError
        The file cannot be written.
    """
    if target:
        write_json(target, content)
    if target != "-":
        say(words)


def make_folder(path: Path) -> None:
    """Create a folder with its parents if it does not exist.

    Raises
    ------
    ConfigurationError
        The folder cannot be created.
    """
    with writing(path):
        path.mkdir(parents=True, exist_ok=True)
