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

"""Trees of arrays: MAT of MATLAB (5 by SciPy, 7.3 as HDF5) and HDF5, by h5py."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from flea_diag.errors import ConfigurationError, RecordingError, shown
from flea_diag.tools.extra import require
from flea_diag.tools.tables.arrays import columns_of
from flea_diag.tools.tables.table import MOST_CELLS, ColumnTable
from flea_diag.wire.bags.budget import Budget

HDF5_MARK = b"\x89HDF\r\n\x1a\n"
DEEPEST = 8


def mat(path: Path, stream: IO[bytes], wanted: Sequence[str] | None, budget: Budget) -> ColumnTable:
    """Variables of a MAT file, fields of structures as ``run.current``."""
    head = stream.read(600)
    stream.seek(0)
    if b"MATLAB 7.3" in head[:128] or HDF5_MARK in (head[:8], head[512:520]):
        return hdf5(path, stream, wanted, budget)
    from scipy.io import loadmat, whosmat

    try:
        budget.unpack(8 * sum(int(np.prod(shape)) for _, shape, _ in whosmat(stream)))
        stream.seek(0)
        read = loadmat(stream, simplify_cells=True)
    except RecordingError:
        raise
    except Exception as error:  # whatever SciPy makes of damaged bytes
        raise RecordingError(f"{path}: not a MAT file: {shown(str(error))}") from error
    arrays = dict(_leaves({k: v for k, v in read.items() if not k.startswith("__")}, "", 0))
    return columns_of(path, arrays, wanted)


def _leaves(tree: Mapping[str, Any], prefix: str, depth: int) -> Iterator[tuple[str, Any]]:
    for name, value in tree.items():
        label = f"{prefix}{name}"
        if isinstance(value, Mapping):
            if depth < DEEPEST:
                yield from _leaves(value, f"{label}.", depth + 1)
        else:
            yield label, np.asarray(value)


def hdf5(
    path: Path, stream: IO[bytes], wanted: Sequence[str] | None, budget: Budget
) -> ColumnTable:
    """Data sets of an HDF5 file, by their paths; their attribute ``units`` is their unit."""
    require("hdf5", str(path))
    import h5py

    arrays: dict[str, npt.NDArray[Any]] = {}
    units: dict[str, str] = {}
    left_out: list[str] = []

    def visit(name: str, found: Any) -> None:
        if not isinstance(found, h5py.Dataset) or name.startswith("#"):
            return
        if found.dtype.hasobject or found.ndim > 2 or found.size > MOST_CELLS:
            left_out.append(name)
            return
        budget.unpack(found.size * found.dtype.itemsize)
        read = found[()]
        unit = found.attrs.get("units", found.attrs.get("unit", ""))
        for key in found.dtype.names or ("",):
            label = f"{name}/{key}" if key else name
            arrays[label] = np.asarray(read[key] if key else read)
            units[label] = unit.decode() if isinstance(unit, bytes) else str(unit)

    try:
        with h5py.File(stream, "r") as file:
            file.visititems(visit)
    except (RecordingError, ConfigurationError):
        raise
    except Exception as error:  # whatever h5py makes of damaged bytes
        raise RecordingError(f"{path}: not an HDF5 file: {shown(str(error))}") from error
    table = columns_of(path, arrays, wanted, left_out)
    known = {name: units[name] for name in table.columns if units.get(name)}
    return ColumnTable(table.columns, known, table.texts, table.moments, table.notes)
