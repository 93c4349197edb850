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

"""Arrays by name as columns: vectors, matrices with a column each, and what is neither."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from flea_diag.errors import RecordingError, shown
from flea_diag.tools.tables.table import MOST_CELLS, ColumnTable, places

MOST_WIDE = 64
"""Columns of a matrix that are looked at: a wider one is an image."""
_EPOCH_KINDS = "M"


@dataclass(frozen=True)
class Shape:
    """Shape and type of an array that is not read yet."""

    rows: int
    width: int
    is_numbers: bool


def columns_of(
    path: Path,
    arrays: Mapping[str, npt.NDArray[Any]],
    wanted: Sequence[str] | None,
    left_out: Sequence[str] = (),
) -> ColumnTable:
    """Columns of arrays in memory.

    Vectors are columns of their name, matrices of their name with a number: ``q_0``, ``q_1``.
    Arrays of another length than most, and what holds no numbers, are left out.

    Raises
    ------
    RecordingError
        A wanted column is none of them.
    """
    found: dict[str, npt.NDArray[Any]] = {}
    moments, texts = set(), list(left_out)
    given = _named(arrays)
    for name, array in arrays.items():
        if array.dtype.kind not in "fiubM" or array.ndim not in (1, 2) or not array.size:
            texts.append(name)
            continue
        tall = array if array.ndim == 1 or array.shape[0] >= array.shape[1] else array.T
        if tall.ndim == 2 and tall.shape[1] > MOST_WIDE:
            texts.append(name)
            continue
        for place, column in enumerate(tall.reshape(len(tall), -1).T):
            one = tall.ndim == 1 or tall.shape[1] == 1
            label = name if one else given.get((name, place), f"{name}_{place}")
            found[label] = column
            if array.dtype.kind in _EPOCH_KINDS:
                moments.add(label)
    lengths = [len(each) for each in found.values()]
    rows = max(set(lengths), key=lengths.count, default=0)
    if wanted is None:
        odd = [n for n, each in found.items() if len(each) != rows]
        single = [n for n in odd if len(found[n]) <= 1]
        notes = [f"{shown(n)} has {len(found[n])} rows, the others {rows}: left out"
                 for n in odd if n not in single]  # fmt: skip
        names: Sequence[str] = [n for n in found if n not in odd]
        texts += odd
    else:
        places(path, wanted, list(found) + texts)
        names, notes = wanted, []
        _check(path, names, found, arrays)
    if rows * len(names) > MOST_CELLS:
        raise RecordingError(f"{path}: more than {MOST_CELLS} cells; cut the file")
    kept = {name: _numbers(found[name]) for name in names}
    return ColumnTable(kept, {}, tuple(texts), frozenset(moments), tuple(notes))


def _named(arrays: Mapping[str, npt.NDArray[Any]]) -> dict[tuple[str, int], str]:
    """Names of a matrix's columns, where an array of texts beside it has as many."""
    matrices = [(n, a) for n, a in arrays.items() if a.ndim == 2 and a.dtype.kind in "fiub"]
    lists = [a.ravel() for a in arrays.values() if a.dtype.kind == "U" and a.size > 1]
    if len(matrices) != 1:
        return {}
    name, matrix = matrices[0]
    width = min(matrix.shape)
    for texts in lists:
        if len(texts) == width == len(set(texts.tolist())):
            return {(name, k): str(text) for k, text in enumerate(texts)}
    return {}


def _check(
    path: Path,
    names: Sequence[str],
    found: Mapping[str, npt.NDArray[Any]],
    arrays: Mapping[str, npt.NDArray[Any]],
) -> None:
    for name in names:
        if name not in found:
            kind = arrays[name].dtype if name in arrays else "object"
            dimensions = arrays[name].ndim if name in arrays else 1
            raise RecordingError(
                f"{path}: {shown(name)} is of type {kind} in {dimensions} dimensions; a column "
                "is one row of numbers"
            )
    lengths = sorted({len(found[name]) for name in names})
    if len(lengths) > 1:
        raise RecordingError(f"{path}: its columns have {lengths} rows; they need as many")


def _numbers(column: npt.NDArray[Any]) -> npt.NDArray[np.float64]:
    if column.dtype.kind in _EPOCH_KINDS:
        whole = column.astype("datetime64[ns]").astype(np.int64)
        return np.where(np.isnat(column), np.nan, whole * 1e-9)
    return np.asarray(column, dtype=np.float64)
