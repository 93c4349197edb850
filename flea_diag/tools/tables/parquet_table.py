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

"""Tables in Parquet, by pyarrow."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from flea_diag.errors import RecordingError, shown
from flea_diag.tools.extra import require
from flea_diag.tools.tables.arrays import MOST_WIDE, columns_of
from flea_diag.tools.tables.cells import moment_s, number
from flea_diag.tools.tables.table import ColumnTable
from flea_diag.wire.bags.budget import Budget

MOST_TEXT = 0.05
"""Share of the texts of a column of numbers that may be none."""


def parquet(
    path: Path, stream: IO[bytes], wanted: Sequence[str] | None, budget: Budget
) -> ColumnTable:
    """Columns of a Parquet file; lists of one length are a column for each element."""
    require("parquet", str(path))
    import pyarrow
    from pyarrow import parquet as pq

    arrays: dict[str, npt.NDArray[Any]] = {}
    texts = []
    try:
        file = pq.ParquetFile(stream)
        names = list(file.schema_arrow.names)
        read = names if wanted is None else [n for n in names if _is_wanted(n, wanted)]
        budget.unpack(8 * file.metadata.num_rows * len(read))
        table: Any = file.read(columns=read)
        for name in read:
            found = _array(table[name])
            if found is None:
                texts.append(name)
            else:
                arrays[name] = found
    except (pyarrow.ArrowException, ValueError, TypeError) as error:
        raise RecordingError(f"{path}: not a Parquet file: {shown(str(error))}") from error
    others = [n for n in names if n not in read]
    return columns_of(path, arrays, wanted, [*texts, *others])


def _is_wanted(name: str, wanted: Sequence[str]) -> bool:
    return any(each == name or each.rpartition("_")[0] == name for each in wanted)


def _array(column: Any) -> npt.NDArray[Any] | None:
    """Numbers, or moments, of a column; None for texts and structures."""
    import pyarrow as pa

    kind = column.type
    if pa.types.is_timestamp(kind):
        return np.asarray(column.cast(pa.timestamp("ns")).to_numpy())
    if pa.types.is_list(kind) or pa.types.is_large_list(kind) or pa.types.is_fixed_size_list(kind):
        rows = column.to_pylist()
        widths = {len(row) for row in rows if row is not None}
        if len(widths) != 1 or not 0 < (width := widths.pop()) <= MOST_WIDE:
            return None
        empty = [None] * width
        return np.array([row or empty for row in rows], dtype=np.float64)
    if pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_decimal(kind):
        return np.asarray(column.cast(pa.float64()).to_numpy(), dtype=np.float64)
    if pa.types.is_string(kind) or pa.types.is_large_string(kind):
        return _of_texts(column.to_pylist())
    return None


def _of_texts(cells: Sequence[str | None]) -> npt.NDArray[np.float64] | None:
    found = [_reading(cell) if cell is not None else np.nan for cell in cells]
    bad = sum(each is None for each in found)
    if bad > MOST_TEXT * len(found):
        return None
    return np.array([np.nan if each is None else each for each in found])


def _reading(cell: str) -> float | None:
    plain = number(cell)
    return moment_s(cell) if plain is None else plain
