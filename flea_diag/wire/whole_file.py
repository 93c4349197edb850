"""Files that are replaced in one step: a reader finds the old one or the new one."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path


def replace_file(path: Path, content: bytes, *, durable: bool = False) -> None:
    """Write a file whole; ``durable`` waits until it would outlive a power cut.

    Raises
    ------
    OSError
        When it cannot be written; the old one is still there then.
    """
    # A pipe or a device is written to; a file in its place would take it from everybody.
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
