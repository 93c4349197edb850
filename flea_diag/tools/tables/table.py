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

"""What a table holds, whatever the format of its file."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from flea_diag.errors import RecordingError, shown

Array = npt.NDArray[np.float64]
MOST_CELLS = 50_000_000


@dataclass(frozen=True, eq=False)
class ColumnTable:
    """Columns of numbers, all of one length; NaN where a cell is empty.

    Parameters
    ----------
    columns
        Name -> readings, shape (rows,). Dates and times of day are in seconds.
    units
        Name -> unit as its row of units says it; without entry where there is none.
    texts
        Names of columns that hold no numbers.
    moments
        Names of columns that were written as dates or times of day.
    notes
        What was done to the file so that it could be read, a line each.
    """

    columns: Mapping[str, Array]
    units: Mapping[str, str] = field(default_factory=dict)
    texts: tuple[str, ...] = ()
    moments: frozenset[str] = frozenset()
    notes: tuple[str, ...] = ()


class NoColumnError(RecordingError):
    """A column is not in the table, which has these."""

    def __init__(self, path: Path, name: str, known: Iterable[str]) -> None:
        self.name, self.known = name, tuple(known)
        has = ", ".join(shown(each)[1:-1] for each in self.known[:20] if each)
        super().__init__(f"{path} has no column {shown(name)}, it has {has or 'none'}")


def places(path: Path, wanted: Sequence[str], known: Sequence[str]) -> list[int]:
    """Place of each wanted column.

    Raises
    ------
    RecordingError
        A column is not there, or there twice.
    """
    for name in wanted:
        if known.count(name) != 1:
            if name in known:
                raise RecordingError(f"{path} has {known.count(name)} columns {shown(name)}")
            raise NoColumnError(path, name, known)
    return [known.index(name) for name in wanted]


def unique(known: Sequence[str]) -> tuple[str, ...]:
    """Names that one column has."""
    return tuple(name for name in known if name and known.count(name) == 1)
