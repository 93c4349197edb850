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

"""What several tests share; no test imports another test."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from typing import TypeVar
from zlib import crc32

T = TypeVar("T")
ALL, TURN = "ALL_EXAMPLES", "TURN_OF_CASES"
SHARE = 4
"""Of so many examples one is tried, unless all are asked for."""
DAY_S = 86_400

# Set by the process that starts the workers: all of them have to find the same tests.
os.environ.setdefault(TURN, str(int(time.time()) // DAY_S))


def examples(most: int) -> int:
    """A quarter of ``most``; all of them where the variable ``ALL_EXAMPLES`` is set."""
    return most if os.environ.get(ALL) else max(most // SHARE, 1)


def in_turn(cases: Sequence[T], share: int = SHARE) -> list[T]:
    """Every so-and-so-many-th of these cases, others each day; all with ``ALL_EXAMPLES``.

    For cases that take the same way through the code as their neighbours, and take seconds.
    """
    if os.environ.get(ALL):
        return list(cases)
    return list(cases[int(os.environ[TURN]) % share :: share])


def its_turn(name: str, share: int) -> bool:
    """Whether a test of this name is tried today, of every so-and-so-many days one."""
    turn = int(os.environ[TURN])
    return bool(os.environ.get(ALL)) or (crc32(name.encode()) - turn) % share == 0
