"""What every command says to the person at the terminal."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from flea_diag.errors import ConfigurationError

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


def write_json(target: str, content: Any) -> None:
    """Write JSON to a file, which is replaced in one step, or to standard output for ``-``.

    Raises
    ------
    ConfigurationError
        When the file cannot be written.
    """
    text = json.dumps(content, indent=2, allow_nan=False) + "\n"
    if target == "-":
        sys.stdout.write(text)
        return
    path = Path(target)
    fresh = path.with_name(f".{path.name}.new")
    try:
        fresh.write_text(text, encoding="utf-8")
        fresh.replace(path)
    except OSError as error:
        raise ConfigurationError(f"cannot write {path}: {error.strerror or error}") from error
