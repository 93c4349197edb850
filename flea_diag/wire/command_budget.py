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

"""What the files of one command may take together: bytes, unpacked bytes, messages, CPU time.

A file is granted a share by its size, for a large one takes long to read and is no attack; small
files have a least share in common. One file by itself has the same limits.
"""

from __future__ import annotations

import os
from collections.abc import MutableSequence
from enum import IntEnum
from typing import NamedTuple, NoReturn

from flea_diag.errors import RecordingError

MEGABYTE = 1_000_000


class Quantity(IntEnum):
    """What is limited, in the order of ``LIMITS``."""

    BYTES = 0
    UNPACKED = 1
    MESSAGES = 2
    SECONDS = 3


class Limit(NamedTuple):
    """Limit of one quantity.

    ``least`` holds for files of any size, in units of ``unit``; each byte of a file adds
    ``per_byte``. ``variable`` is the environment variable that raises ``least``.
    """

    says: str
    unit_name: str
    unit: int
    least: int
    per_byte: float
    variable: str


LIMITS = (
    Limit("files of", "MB", MEGABYTE, 1_000_000, 0.0, "FLEA_READ_LIMIT_MB"),
    # Recordings of a stand at rest come close to 1000.
    Limit("it unpacks to", "MB", MEGABYTE, 1000, 1000.0, "FLEA_BAG_LIMIT_MB"),
    # Stamps and numbers of messages differ, so that each takes some bytes in the file.
    Limit("it contains", "messages", 1, 300_000, 1.0, "FLEA_MESSAGE_LIMIT"),
    # Reading takes some hundredths of it; a small computer is ten times slower.
    Limit("reading takes", "s of CPU time", 1, 10, 10.0 / MEGABYTE, "FLEA_READ_LIMIT_S"),
)
"""One row per ``Quantity``."""


def least(quantity: Quantity) -> float:
    """Limit for files of any size: of the table, or of the environment variable."""
    limit = LIMITS[quantity]
    asked = os.environ.get(limit.variable, "")
    number = int(asked) if asked.isdigit() and len(asked) < 10 else limit.least
    return float(number) * limit.unit


def refuse(name: str, quantity: Quantity, most: float, together: bool = False) -> NoReturn:
    """Say which limit is exceeded and how to raise it.

    Raises
    ------
    RecordingError
        Always.
    """
    limit = LIMITS[quantity]
    before = "with the files read before " if together else ""
    raised = max(10 * limit.least, 10_000)
    raise RecordingError(
        f"{name}: {before}{limit.says} more than {most / limit.unit:.0f} {limit.unit_name}; "
        f"if it is sound, raise the limit: {limit.variable}={raised}"
    )


class CommandBudget:
    """Sums over all files of a command; ``shared`` sums are those of its worker processes, too."""

    def __init__(self, shared: MutableSequence[float] | None = None) -> None:
        self.sums = [0.0] * (2 * len(LIMITS)) if shared is None else shared
        self._files: set[tuple[int, int]] = set()

    def grant(self, quantity: Quantity, amount: float) -> None:
        """Grant a file its share."""
        self._add(len(LIMITS) + quantity, amount)

    def charge(self, name: str, quantity: Quantity, amount: float) -> None:
        """Charge what the file ``name`` takes.

        Raises
        ------
        RecordingError
            It is more than all files together may take.
        """
        used = self._add(quantity, amount)
        most = max(least(quantity), self.sums[len(LIMITS) + quantity])
        if used > most:
            refuse(name, quantity, most, together=True)

    def open(self, name: str, identity: tuple[int, int], size_bytes: int) -> None:
        """Charge the size of a file that is opened, once however often that is."""
        if identity not in self._files:
            self._files.add(identity)
            self.charge(name, Quantity.BYTES, size_bytes)

    def _add(self, place: int, amount: float) -> float:
        lock = getattr(self.sums, "get_lock", None)
        if lock is None:
            self.sums[place] += amount
            return self.sums[place]
        with lock():
            self.sums[place] += amount
            return self.sums[place]


_current: CommandBudget | None = None
"""None in programs that run for ever: there each file has its own limits only."""


def begin_command(shared: MutableSequence[float] | None = None) -> None:
    """Forget what was read before: a new command begins, or a worker process of one."""
    global _current
    _current = CommandBudget(shared)


def end_command() -> None:
    """Limit each file by itself, as in programs that run for ever."""
    global _current
    _current = None


def current() -> CommandBudget | None:
    """Budget of the command that runs."""
    return _current


def shared_sums() -> MutableSequence[float] | None:
    """Sums of this command in memory that worker processes share; None outside of commands."""
    if _current is None:
        return None
    if isinstance(_current.sums, list):
        from multiprocessing import get_context

        sums = get_context("spawn").Array("d", _current.sums)
        _current.sums = sums  # type: ignore[assignment,unused-ignore]
    return _current.sums
