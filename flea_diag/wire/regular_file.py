"""Opens external files: regular files only, never a device, a pipe or a socket.

Reading ``/dev/zero`` never ends, and a FIFO without a writer blocks. The check is made on the
opened file, so that the name cannot be redirected after it.
"""

from __future__ import annotations

import os
import stat
from pathlib import Path
from typing import IO

from flea_diag.errors import RecordingError


def opened(path: Path) -> IO[bytes]:
    """Open a regular file for reading in binary mode.

    Raises
    ------
    RecordingError
        The path is not a regular file.
    OSError
        The file cannot be opened.
    """
    # Without O_NONBLOCK, opening a FIFO blocks.
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise RecordingError(f"{path}: no regular file, it is not read")
    return os.fdopen(descriptor, "rb")


def read_bytes(path: Path, limit_bytes: int) -> bytes:
    """Content of a regular file of at most ``limit_bytes``.

    Raises
    ------
    RecordingError
        The path is not a regular file, or the file is too large.
    OSError
        The file cannot be read.
    """
    with opened(path) as stream:
        data = stream.read(limit_bytes + 1)
    if len(data) > limit_bytes:
        raise RecordingError(f"{path}: above its limit of {limit_bytes} bytes, it is not read")
    return data
