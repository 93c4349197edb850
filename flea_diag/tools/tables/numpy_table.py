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

"""Arrays of NumPy: NPZ with one for each column or a matrix, and NPY."""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from flea_diag.errors import RecordingError, shown
from flea_diag.tools.tables.arrays import columns_of
from flea_diag.tools.tables.table import MOST_CELLS, ColumnTable
from flea_diag.wire.bags.budget import Budget


def npz(path: Path, stream: IO[bytes], wanted: Sequence[str] | None, budget: Budget) -> ColumnTable:
    """Columns of an NPZ file; Python objects in it are not loaded."""
    arrays: dict[str, npt.NDArray[Any]] = {}
    objects = []
    try:
        with zipfile.ZipFile(stream) as archive:
            for info in archive.infolist():
                name = info.filename.removesuffix(".npy")
                budget.unpack(info.file_size)
                with archive.open(info) as member:
                    found = _array(path, member, name, info.file_size)
                if found is None:
                    objects.append(name)
                else:
                    arrays[name] = found
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError) as error:
        raise RecordingError(f"{path}: not an NPZ file: {error}") from error
    return columns_of(path, arrays, wanted, objects)


def npy(path: Path, stream: IO[bytes], wanted: Sequence[str] | None, budget: Budget) -> ColumnTable:
    """Columns of one array: ``column_0``, ``column_1``, or the fields of a record array."""
    size = stream.seek(0, 2)
    stream.seek(0)
    budget.unpack(size)
    found = _array(path, stream, "column", size)
    if found is None:
        raise RecordingError(f"{path} holds Python objects, which are not loaded; save numbers")
    if found.dtype.names:
        return columns_of(path, {n: found[n] for n in found.dtype.names}, wanted)
    return columns_of(path, {"column": found}, wanted)


def _array(path: Path, member: IO[bytes], name: str, size: int) -> npt.NDArray[Any] | None:
    """One array; its header is held against its size before anything is made of it.

    None: it holds Python objects.
    """
    fmt = np.lib.format
    try:
        version = fmt.read_magic(member)
        read = fmt.read_array_header_1_0 if version == (1, 0) else fmt.read_array_header_2_0
        shape, by_columns, dtype = read(member)
        if dtype.hasobject:
            return None
        count = int(np.prod(shape, dtype=np.float64))
        if count > MOST_CELLS or count * dtype.itemsize > size:
            raise RecordingError(
                f"{path}: {shown(name)} is of shape {shape} and type {dtype} with {size} bytes; at "
                f"most {MOST_CELLS} numbers are read, and none that the file does not hold"
            )
        data = member.read(count * dtype.itemsize)
        flat = np.frombuffer(data, dtype, count=count)
        return flat.reshape(shape, order="F" if by_columns else "C")
    except ValueError as error:
        raise RecordingError(f"{path}: {shown(name)} cannot be read: {error}") from error
