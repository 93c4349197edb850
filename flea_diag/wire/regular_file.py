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

"""Files of others are opened here: regular ones alone, no device, pipe, socket or folder.

``/dev/zero`` has no end, and a FIFO that nobody writes to has no beginning. The look is taken at
what has been opened, not at what the name pointed to before. Whoever reads names the error that
the file raises: a calibration another one than a recording.
"""

from __future__ import annotations

import os
import stat
from itertools import islice
from pathlib import Path
from typing import IO

from flea_diag.errors import InputError, RecordingError, nearest
from flea_diag.wire.command_budget import current

MOST_NAMES = 1000
"""Of a folder, among which a like one is looked for."""
# Without O_NONBLOCK a FIFO would be waited for.
_FLAGS = os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC | os.O_NOCTTY


def opened(
    path: Path, limit_bytes: int | None = None, refusal: type[InputError] = RecordingError
) -> IO[bytes]:
    """Open a regular file to be read in binary form.

    The limit is that of its size as it is opened; whoever reads on while it grows bounds that.
    Its size is charged to the budget of the command.

    Raises
    ------
    InputError
        ``refusal``: it is no regular file, larger than the limit, or more than may be read.
    OSError
        The file cannot be opened.
    """
    descriptor = os.open(path, _FLAGS)
    try:
        _check(os.fstat(descriptor), path, limit_bytes)
    except RecordingError as error:
        os.close(descriptor)
        raise refusal(str(error)) from None
    return os.fdopen(descriptor, "rb")


def missing(path: Path) -> RecordingError:
    """The refusal of a recording that is not there, with what lies beside it under a like name."""
    folder = path.parent
    names = [each.name for each in islice(folder.iterdir(), MOST_NAMES)] if folder.is_dir() else []
    near = nearest(path.name, names)
    meant = f", did you mean {folder / near}?" if near else ""
    where = "" if folder.is_dir() else f": there is no folder {folder}"
    return RecordingError(f"{path} does not exist{where}{meant}")


def _check(found: os.stat_result, path: Path, limit_bytes: int | None) -> None:
    if not stat.S_ISREG(found.st_mode):
        raise RecordingError(f"{path}: no regular file, it is not read: name a file on disk")
    if limit_bytes is not None and found.st_size > limit_bytes:
        raise RecordingError(_too_large(path, found.st_size, limit_bytes))
    command = current()
    if command is not None:
        command.open(str(path), (found.st_dev, found.st_ino), found.st_size)


def read_bytes(path: Path, limit_bytes: int, refusal: type[InputError] = RecordingError) -> bytes:
    """Content of a regular file of at most so many bytes.

    Raises
    ------
    InputError
        ``refusal``: it is no regular file, or larger, if only since it was opened.
    OSError
        The file cannot be read.
    """
    with opened(path, limit_bytes, refusal) as stream:
        data = stream.read(limit_bytes + 1)
    if len(data) > limit_bytes:
        raise refusal(_too_large(path, len(data), limit_bytes))
    return data


def read_text(path: Path, limit_bytes: int, refusal: type[InputError] = RecordingError) -> str:
    """Text in UTF-8 of a regular file of at most so many bytes, every line end a line feed.

    Raises
    ------
    InputError
        ``refusal``: it is no regular file, larger, or not UTF-8.
    OSError
        It cannot be read.
    """
    try:
        text = read_bytes(path, limit_bytes, refusal).decode("utf-8")
    except UnicodeDecodeError as error:
        raise refusal(f"{path}: not a text file: {error}") from error
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _too_large(path: Path, size: int, limit_bytes: int) -> str:
    return f"{path}: {size} bytes, above the limit of {limit_bytes} bytes, it is not read"
