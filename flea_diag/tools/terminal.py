"""What every command says to the person at the terminal, and how it writes files for them."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from flea_diag.errors import ConfigurationError
from flea_diag.wire.whole_file import replace_file

IN_PART = 1
"""Exit status of a batch of which something was refused or lost."""


def warn(words: str) -> None:
    """Say a line on standard error, clear of a progress line."""
    clear = "\r\x1b[K" if sys.stderr.isatty() else ""
    print(f"{clear}flea: {words}", file=sys.stderr)


def progress(number: int, count: int, name: str) -> None:
    """Show which of how many is being worked on, where somebody can see it."""
    if sys.stderr.isatty():
        end = "\n" if number == count else ""
        print(f"\r\x1b[K[{number}/{count}] {name}", end=end, file=sys.stderr, flush=True)


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Whatever keeps a file or a folder from being written, as one line that names it.

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
    """Write a file, which is replaced in one step: a reader finds the old one or the new one.

    Raises
    ------
    ConfigurationError
        When the file cannot be written.
    """
    with writing(path):
        replace_file(path, text.encode())


def write_json(target: str, content: Any) -> None:
    """Write JSON to a file, or to standard output for ``-``.

    Raises
    ------
    ConfigurationError
        When the file cannot be written.
    """
    text = json.dumps(content, indent=2, allow_nan=False) + "\n"
    if target == "-":
        sys.stdout.write(text)
    else:
        write_text(Path(target), text)


def make_folder(path: Path) -> None:
    """Make a folder with its parents, where it is not there yet.

    Raises
    ------
    ConfigurationError
        When it cannot be made.
    """
    with writing(path):
        path.mkdir(parents=True, exist_ok=True)
