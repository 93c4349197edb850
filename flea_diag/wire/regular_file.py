"""Files of others are opened here: regular ones alone, never a device, a pipe or a socket.

``/dev/zero`` has no end, and a FIFO that nobody writes to has no beginning. The look is taken at
what has been opened, not at what the name pointed to before.
"""

from __future__ import annotations

import os
import stat
from pathlib import Path
from typing import IO

from flea_diag.errors import RecordingError


def opened(path: Path) -> IO[bytes]:
    """Open a regular file to be read in binary form.

    Raises
    ------
    RecordingError
        It is no regular file.
    OSError
        It cannot be opened.
    """
    # Without O_NONBLOCK a FIFO would be waited for.
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise RecordingError(f"{path}: no regular file, it is not read")
    return os.fdopen(descriptor, "rb")


def read_bytes(path: Path, limit_bytes: int) -> bytes:
    """Content of a regular file of at most so many bytes.

    Raises
    ------
    RecordingError
        It is no regular file, or larger.
    OSError
        It cannot be read.
    """
    with opened(path) as stream:
        data = stream.read(limit_bytes + 1)
    if len(data) > limit_bytes:
        raise RecordingError(f"{path}: above its limit of {limit_bytes} bytes, it is not read")
    return data
