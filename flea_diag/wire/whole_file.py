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

"""Atomic replacement of files and folders: a reader sees either the old or the new content."""

from __future__ import annotations

import errno
import os
import secrets
import shutil
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

NEW_FILE = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC


def replace_file(path: Path, content: bytes, *, durable: bool = False) -> None:
    """Replace a file atomically; ``durable`` also flushes it to disk, against a power failure.

    The new content is written under a name of its own, so that several writers do not mix theirs;
    the file keeps its mode, and a link is replaced, not followed.

    Raises
    ------
    OSError
        The file cannot be written; the old content is kept.
    """
    # A pipe or a device must be written to, not replaced by a file.
    if path.exists() and not path.is_file():
        path.write_bytes(content)
        return
    fresh = _beside(path)
    try:
        with os.fdopen(os.open(fresh, NEW_FILE, 0o666), "wb") as file:
            mode = _mode(path)
            if mode is not None:
                os.fchmod(file.fileno(), mode)
            file.write(content)
            if durable:
                file.flush()
                os.fsync(file.fileno())
        fresh.replace(path)
    except OSError:
        with suppress(OSError):
            fresh.unlink()
        raise


@contextmanager
def replacing_folder(path: Path) -> Iterator[Path]:
    """A new folder of the same name elsewhere, which replaces the one at ``path`` in the end.

    Whatever is raised meanwhile, or a kill, leaves the old one as it is.

    Raises
    ------
    OSError
        The folder cannot be made or replaced.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    aside = _beside(path)
    aside.mkdir()
    try:
        fresh, old = aside / path.name, aside / "old"
        yield fresh
        if path.exists():
            path.rename(old)
        try:
            fresh.rename(path)
        except OSError:
            if old.exists():
                old.rename(path)
            raise
    finally:
        shutil.rmtree(aside, ignore_errors=True)


@contextmanager
def new_folder(path: Path) -> Iterator[Path]:
    """A folder that is whole once the block ends, or is not there at all.

    An empty one may be a place that others hold, such as a mount: it is filled, and emptied again
    of what is raised.

    Raises
    ------
    OSError
        Something is there already, or the folder cannot be made.
    """
    if not path.exists():
        with replacing_folder(path.absolute()) as fresh:
            fresh.mkdir()
            yield fresh
        return
    if not path.is_dir() or any(path.iterdir()):
        raise FileExistsError(errno.EEXIST, "exists and is not empty", str(path))
    try:
        yield path
    except BaseException:
        for left in path.iterdir():
            left.unlink()
        raise


def _beside(path: Path) -> Path:
    """A name beside a file that nobody else has."""
    return path.with_name(f".{path.name[:200]}.{secrets.token_hex(4)}.new")


def _mode(path: Path) -> int | None:
    """Mode of the file that is replaced; None where there is none, or a link."""
    try:
        found = path.lstat().st_mode
    except FileNotFoundError:
        return None
    return stat.S_IMODE(found) if stat.S_ISREG(found) else None
