"""Atomic replacement of files: a reader sees either the old or the new content."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path


def replace_file(path: Path, content: bytes, *, durable: bool = False) -> None:
    """Replace a file atomically; ``durable`` also flushes it to disk, against a power failure.

    Raises
    ------
    OSError
        The file cannot be written; the old content is kept.
    """
    # A pipe or a device must be written to, not replaced by a file.
    if path.exists() and not path.is_file():
        path.write_bytes(content)
        return
    fresh = path.with_name(f".{path.name}.new")
    try:
        with fresh.open("wb") as file:
            file.write(content)
            if durable:
                file.flush()
                os.fsync(file.fileno())
        fresh.replace(path)
    except OSError:
        with suppress(OSError):
            fresh.unlink()
        raise
