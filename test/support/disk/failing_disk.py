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

"""A disk whose n-th operation fails, or any that is asked to: below one folder, in this process.

Files are the real ones; what fails is the call of the operating system, as with a full disk or one
that is taken away. Buffers above it are Python's own, so an error may come with a flush or a close.
"""

from __future__ import annotations

import builtins
import errno
import io
import os
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

WRITES = os.O_WRONLY | os.O_RDWR
OF_PATHS = ("mkdir", "replace", "rename", "link", "symlink", "truncate")
OF_DESCRIPTORS = ("write", "pwrite", "fsync", "fdatasync", "ftruncate", "posix_fallocate")
FULL, BROKEN = errno.ENOSPC, errno.EIO


class FailingDisk:
    """Counts what is done below a folder, and fails what it is told to.

    Parameters
    ----------
    folder : whose files are on this disk
    fails : number of an operation, from 1, and its name -> the error number that it ends with, or 0
    """

    def __init__(self, folder: Path, fails: Callable[[int, str], int]) -> None:
        self._folder = os.path.realpath(folder) + os.sep
        self._fails = fails
        self._open: set[int] = set()
        self.count = 0
        """Operations so far."""
        self.failed: list[str] = []
        """Those that have failed, by name and place."""

    def _holds(self, place: Any) -> bool:
        if isinstance(place, int):
            return place in self._open
        try:
            path = os.path.abspath(os.fsdecode(place))
        except TypeError:
            return False
        return path.startswith(self._folder)

    def ask(self, name: str, place: Any) -> None:
        """Count an operation, and fail it if that is due."""
        self.count += 1
        number = self._fails(self.count, name)
        if number:
            self.failed.append(f"{name} {place}")
            raise OSError(number, os.strerror(number), None if isinstance(place, int) else place)

    @contextmanager
    def in_use(self) -> Iterator[FailingDisk]:
        """Whatever is done to files below the folder meanwhile is done to this disk."""
        with ExitStack() as stack:
            for name in (*OF_PATHS, *OF_DESCRIPTORS):
                stack.enter_context(patch.object(os, name, self._asked(name, getattr(os, name))))
            stack.enter_context(patch.object(os, "open", self._opened(os.open)))
            stack.enter_context(patch.object(os, "close", self._closed(os.close)))
            opened = self._file(io.open)
            stack.enter_context(patch.object(io, "open", opened))
            stack.enter_context(patch.object(builtins, "open", opened))
            yield self

    def _asked(self, name: str, real: Any) -> Any:
        def call(place: Any, *more: Any, **named: Any) -> Any:
            if self._holds(place) or (more and name in OF_PATHS and self._holds(more[0])):
                self.ask(name, place)
            return real(place, *more, **named)

        return call

    def _opened(self, real: Any) -> Any:
        def call(path: Any, flags: int, *more: Any, **named: Any) -> int:
            held = bool(flags & WRITES) and "dir_fd" not in named and self._holds(path)
            if held:
                self.ask("open", path)
            made: int = real(path, flags, *more, **named)
            if held:
                self._open.add(made)
            return made

        return call

    def _closed(self, real: Any) -> Any:
        def call(descriptor: int) -> None:
            self._open.discard(descriptor)
            real(descriptor)

        return call

    def _file(self, real: Any) -> Any:
        def call(file: Any, mode: str = "r", buffering: int = -1, *more: Any, **named: Any) -> Any:
            if not set(mode) & set("wax+") or not self._holds(file):
                return real(file, mode, buffering, *more, **named)
            return self._written(file, mode, buffering, *more, **named)

        return call

    def _written(
        self,
        file: Any,
        mode: str,
        buffering: int,
        encoding: str | None = None,
        errors: str | None = None,
        newline: str | None = None,
        closefd: bool = True,
        opener: Any = None,
    ) -> Any:
        if not isinstance(file, int):
            self.ask("open", file)
        raw = _Raw(file, mode.replace("b", "").replace("t", ""), closefd, opener)
        raw.disk = self
        if buffering == 0:
            return raw
        kept = io.BufferedRandom(raw) if "+" in mode else io.BufferedWriter(raw)
        return kept if "b" in mode else io.TextIOWrapper(kept, encoding, errors, newline)


class _Raw(io.FileIO):
    """A file below the buffers of Python."""

    disk: FailingDisk

    def write(self, data: Any) -> int:
        self.disk.ask("write", self.name)
        return super().write(data)

    def truncate(self, size: int | None = None) -> int:
        self.disk.ask("truncate", self.name)
        return super().truncate(size)
