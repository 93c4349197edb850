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

"""The formats of tables, and how a file is read by its name."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import IO
from warnings import catch_warnings, simplefilter

from flea_diag.errors import RecordingError
from flea_diag.tools.tables.excel_table import excel
from flea_diag.tools.tables.numpy_table import npy, npz
from flea_diag.tools.tables.parquet_table import parquet
from flea_diag.tools.tables.table import ColumnTable
from flea_diag.tools.tables.text_table import gzipped, text_table
from flea_diag.tools.tables.tree_table import hdf5, mat
from flea_diag.tools.tables.ulog_table import ulog
from flea_diag.wire.bags.budget import Budget
from flea_diag.wire.regular_file import opened

FILE_LIMIT_BYTES = 1 << 30
Reader = Callable[[Path, IO[bytes], Sequence[str] | None, Budget], ColumnTable]
READERS: dict[str, Reader] = {
    ".csv": text_table,
    ".csv.gz": gzipped,
    ".tsv": text_table,
    ".tsv.gz": gzipped,
    ".txt": text_table,
    ".txt.gz": gzipped,
    ".dat": text_table,
    ".asc": text_table,
    ".npz": npz,
    ".npy": npy,
    ".parquet": parquet,
    ".xlsx": excel,
    ".mat": mat,
    ".h5": hdf5,
    ".hdf5": hdf5,
    ".ulg": ulog,
}
"""Ending of a file's name -> its reader."""


def read_table(path: Path, wanted: Sequence[str] | None = None) -> ColumnTable:
    """The wanted columns of a table, or all that hold numbers.

    Raises
    ------
    RecordingError
        The file cannot be read, lacks a column, or exceeds a limit; names the place.
    """
    read = READERS[suffix_of(path)]
    names = None if wanted is None else tuple(dict.fromkeys(wanted))
    try:
        with opened(path, FILE_LIMIT_BYTES) as stream, catch_warnings():
            simplefilter("ignore")  # of libraries, on files of older makers
            size = stream.seek(0, 2)
            stream.seek(0)
            found = read(path, stream, names, Budget(path.name, size))
    except OSError as error:
        raise RecordingError(f"cannot read {path}: {error.strerror or error}") from error
    lengths = {len(values) for values in found.columns.values()}
    if lengths == {0} or (wanted is not None and len(lengths) != 1):
        raise RecordingError(f"{path}: its columns have {sorted(lengths)} rows; they need as many")
    return found


def suffix_of(path: Path) -> str:
    """Key of ``READERS`` that the name of a file ends on; "" for none."""
    return next((suffix for suffix in READERS if path.name.lower().endswith(suffix)), "")


def stem_of(path: Path) -> str:
    """Name of a file without its suffix."""
    return path.name[: len(path.name) - len(suffix_of(path))]
