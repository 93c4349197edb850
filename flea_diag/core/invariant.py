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

"""What must hold for a verdict to be right, checked in every run.

A broken one is a defect of the diagnosis, not of its input: it ends the stand with one line, for
no verdict is better than a wrong one. Python's ``assert`` may be switched off and is for readers
and type checkers; these stay on. They stand where a group changes and where a block of scans ends,
not in what runs for every scan, and cost microseconds there (``scripts/bench scan``).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from flea_diag.errors import InvariantError

ROUNDING = 1e-9
"""By how much probabilities may miss 1: their sum is rounded, nothing else."""


def finite(what: str, values: Sequence[float]) -> None:
    """All of these are numbers: with a NaN among them the best one depends on their order.

    Raises
    ------
    InvariantError
        One is not.
    """
    if not all(map(math.isfinite, values)):
        raise InvariantError(f"{what}: {list(values)} are not all finite")


def distribution(what: str, shares: Sequence[float]) -> None:
    """Probabilities of everything that is left: none negative, and 1 together.

    Raises
    ------
    InvariantError
        They are none.
    """
    total = math.fsum(shares)
    if not abs(total - 1.0) <= ROUNDING or min(shares) < 0.0:
        raise InvariantError(f"{what}: {list(shares)} add up to {total}, not to 1")


def ordered(what: str, before: int, after: int) -> None:
    """Time goes on: evidence out of order would be weighed twice, or never.

    Raises
    ------
    InvariantError
        It goes back.
    """
    if after < before:
        raise InvariantError(f"{what}: stamp {after} ns after {before} ns")


def shaped(what: str, shape: tuple[int, ...], expected: tuple[int, ...]) -> None:
    """Columns are those that are named: else a value is taken for that of a neighbour.

    Raises
    ------
    InvariantError
        They are not.
    """
    if shape != expected:
        raise InvariantError(f"{what}: shape {shape}, not {expected}")
