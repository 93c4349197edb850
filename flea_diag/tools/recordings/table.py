"""Tables of others: CSV (also gzipped), NPZ and Parquet, as columns of a bounded size."""

from __future__ import annotations

import csv
import gzip
import zipfile
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from io import TextIOWrapper
from pathlib import Path
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from flea_diag.errors import RecordingError, shown
from flea_diag.tools.extra import require
from flea_diag.wire.bags.budget import Budget
from flea_diag.wire.regular_file import opened

FILE_LIMIT_BYTES = 1 << 30
LONGEST_LINE = 100_000
MOST_CELLS = 50_000_000
AT_ONCE = 1000
"""Rows that are charged to the budget together."""
MISSING = ("", "nan", "na", "null", "none")
"""Cells that say that there is no reading."""

Array = npt.NDArray[np.float64]
Columns = dict[str, Array]


def read_table(path: Path, wanted: Sequence[str]) -> Columns:
    """The wanted columns of a table, all of one length; NaN where a cell is empty.

    Raises
    ------
    RecordingError
        The file cannot be read, lacks a column, or exceeds a limit; names the place.
    """
    read = READERS[suffix_of(path)]
    try:
        with opened(path, FILE_LIMIT_BYTES) as stream:
            size = stream.seek(0, 2)
            stream.seek(0)
            found = read(path, stream, tuple(dict.fromkeys(wanted)), Budget(path.name, size))
    except OSError as error:
        raise RecordingError(f"cannot read {path}: {error.strerror or error}") from error
    lengths = {len(values) for values in found.values()}
    if lengths == {0} or len(lengths) != 1:
        raise RecordingError(f"{path}: its columns have {sorted(lengths)} rows; they need as many")
    return found


def suffix_of(path: Path) -> str:
    """Key of ``READERS`` that the name of a file ends on; "" for none."""
    return next((suffix for suffix in READERS if path.name.lower().endswith(suffix)), "")


def stem_of(path: Path) -> str:
    """Name of a file without its suffix."""
    return path.name[: len(path.name) - len(suffix_of(path))]


def header_of(path: Path) -> tuple[str, ...]:
    """Names of the columns of a table."""
    missing: list[str] = []
    try:
        read_table(path, ["\0"])
    except NoColumnError as error:
        missing = list(error.known)
    return tuple(missing)


class NoColumnError(RecordingError):
    """A column is not in the table, which has these."""

    def __init__(self, path: Path, name: str, known: Iterable[str]) -> None:
        self.name, self.known = name, tuple(known)
        has = ", ".join(shown(each)[1:-1] for each in self.known[:20])
        super().__init__(f"{path} has no column {shown(name)}, it has {has or 'none'}")


def _places(path: Path, wanted: Sequence[str], known: Sequence[str]) -> list[int]:
    for name in wanted:
        if known.count(name) != 1:
            if name in known:
                raise RecordingError(f"{path} has {known.count(name)} columns {shown(name)}")
            raise NoColumnError(path, name, known)
    return [known.index(name) for name in wanted]


def _gzipped(path: Path, stream: IO[bytes], wanted: Sequence[str], budget: Budget) -> Columns:
    try:
        with gzip.GzipFile(fileobj=stream) as plain:
            return _csv(path, plain, wanted, budget)
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise RecordingError(f"{path}: cannot be unpacked: {error}") from error


def _csv(path: Path, stream: Any, wanted: Sequence[str], budget: Budget) -> Columns:
    lines = _lines(path, stream, budget)
    head = next(lines, "")
    delimiter = max(",;\t", key=head.count)
    known = [name.strip() for name in next(csv.reader([head], delimiter=delimiter), [])]
    places = _places(path, wanted, known)
    columns: list[list[float]] = [[] for _ in wanted]
    taken = [(place, wanted[k], columns[k].append) for k, place in enumerate(places)]
    for number, row in enumerate(csv.reader(lines, delimiter=delimiter), 2):
        if row:
            _take(path, number, row, taken)
    return {name: np.array(column) for name, column in zip(wanted, columns, strict=True)}


def _take(
    path: Path,
    number: int,
    row: list[str],
    taken: Sequence[tuple[int, str, Callable[[float], None]]],
) -> None:
    for place, name, append in taken:
        text = row[place] if place < len(row) else None
        try:
            append(float(text))  # type: ignore[arg-type]
        except (TypeError, ValueError):
            if text is None:
                raise RecordingError(
                    f"{path}: line {number} has {len(row)} columns, {shown(name)} is the "
                    f"{place + 1}th; the file is cut off or damaged there"
                ) from None
            if text.strip().lower() not in MISSING:
                raise RecordingError(
                    f"{path}: line {number}: {shown(name)} = {shown(text)} is not a number"
                ) from None
            append(np.nan)


def _lines(path: Path, stream: IO[bytes], budget: Budget) -> Iterator[str]:
    """Lines of a text, charged to the budget as they are unpacked."""
    text = TextIOWrapper(stream, encoding="utf-8-sig", errors="replace", newline="")
    budget.resume()
    unpacked = 0
    for number, line in enumerate(iter(lambda: text.readline(LONGEST_LINE + 1), ""), 1):
        if len(line) > LONGEST_LINE:
            raise RecordingError(f"{path}: line {number} has more than {LONGEST_LINE} characters")
        unpacked += len(line)
        if number % AT_ONCE == 0:
            budget.unpack(unpacked)
            budget.spend()
            unpacked = 0
        yield line
    budget.unpack(unpacked)


def _npz(path: Path, stream: IO[bytes], wanted: Sequence[str], budget: Budget) -> Columns:
    try:
        with zipfile.ZipFile(stream) as archive:
            members = {info.filename.removesuffix(".npy"): info for info in archive.infolist()}
            _places(path, wanted, list(members))
            return {name: _array(path, archive, members[name], name, budget) for name in wanted}
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError) as error:
        raise RecordingError(f"{path}: not an NPZ file: {error}") from error


def _array(
    path: Path, archive: zipfile.ZipFile, info: zipfile.ZipInfo, name: str, budget: Budget
) -> Array:
    """One column; its header is held against its size before anything is made of it."""
    budget.unpack(info.file_size)
    fmt = np.lib.format
    try:
        with archive.open(info) as member:
            version = fmt.read_magic(member)
            read = fmt.read_array_header_1_0 if version == (1, 0) else fmt.read_array_header_2_0
            shape, _, dtype = read(member)
            sized = dtype.kind in "fiub" and len(shape) == 1 and shape[0] <= MOST_CELLS
            if not sized or shape[0] * dtype.itemsize > info.file_size:
                raise RecordingError(
                    f"{path}: {shown(name)} is of type {dtype} in {len(shape)} dimensions with "
                    f"{info.file_size} bytes; a column is one row of numbers"
                )
            data = member.read(shape[0] * dtype.itemsize)
            return np.frombuffer(data, dtype, count=shape[0]).astype(np.float64)
    except ValueError as error:
        raise RecordingError(f"{path}: {shown(name)} cannot be read: {error}") from error


def _parquet(path: Path, stream: IO[bytes], wanted: Sequence[str], budget: Budget) -> Columns:
    require("parquet", str(path))
    import pyarrow
    from pyarrow import parquet

    try:
        file = parquet.ParquetFile(stream)
        _places(path, wanted, list(file.schema_arrow.names))
        budget.unpack(8 * file.metadata.num_rows * len(wanted))
        table: Mapping[str, Any] = file.read(columns=list(wanted))
        return {name: np.asarray(table[name], dtype=np.float64) for name in wanted}
    except (pyarrow.ArrowException, ValueError, TypeError) as error:
        raise RecordingError(
            f"{path}: not a Parquet file of numbers: {shown(str(error))}"
        ) from error


READERS: dict[str, Callable[[Path, IO[bytes], Sequence[str], Budget], Columns]] = {
    ".csv": _csv,
    ".csv.gz": _gzipped,
    ".npz": _npz,
    ".parquet": _parquet,
}
