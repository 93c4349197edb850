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

"""Frames, datasets and arrays as recordings: every column is checked before anything runs."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from difflib import get_close_matches
from typing import Any

import numpy as np
import numpy.typing as npt

from flea_diag.api.recording import Recording, kept
from flea_diag.api.stand_facts import channels_of
from flea_diag.configuration.calibrations import learned
from flea_diag.configuration.stand import Stand, load_stand, shipped_stands
from flea_diag.core.residuals.channel_units import unit_refusal
from flea_diag.errors import RecordingError, shown
from flea_diag.wire.blocks import ScanBlock
from flea_diag.wire.records import ChannelInfo, ChannelTable, Record

SECONDS, STAMPS = "time_s", "stamp_ns"
TIMES = (SECONDS, STAMPS)
"""Columns that hold the times of the rows: seconds, or nanoseconds since 1970."""
START_NS = 1_000_000_000_000_000_000
"""Stamp of 0 s where the rows say no date: in 2001."""
BLOCK_ROWS = 2048
FEWEST_ROWS = 2
MOST_APART = 0.2
"""Share by which the period of rows may differ from the calibration's."""

Array = npt.NDArray[np.float64]
Stamps = npt.NDArray[np.int64]


def recording_of(
    data: Any,
    stand: Stand,
    *,
    name: str = "frame",
    rate_hz: float | None = None,
    units: Mapping[str, str] | None = None,
) -> Recording:
    """Rows of channels as a recording; see ``fd.diagnose`` for what they may be.

    Raises
    ------
    RecordingError
        Names the column, the row where one is to blame, and the remedy.
    """
    columns, index, attrs = _parts(data)
    told = attrs.get("channels", {})
    given = {**{n: row.get("unit", "") for n, row in told.items()}, **attrs.get("units", {})}
    given |= units or {}
    start_ns = int(attrs.get("start_ns", START_NS))
    stamps = _stamps(columns, index, rate_hz, start_ns)
    read = {each: columns[each] for each in columns if each not in TIMES}
    known = channels_of(stand)
    _check_names(read, stand, told)
    values = np.column_stack(
        [_numbers(each, read[each], len(stamps), each in told) for each in read]
    )
    rate = 1e9 / float(np.median(np.diff(stamps)))
    rows = tuple(_info(each, given.get(each, known.get(each, "")), rate, told.get(each))
                 for each in read)  # fmt: skip
    _check_units(rows, known)
    table = ChannelTable(int(stamps[0]), str(attrs.get("stand", stand.name)), rows)
    return kept(name, _records(table, stamps, tuple(read), values), stand)


def check_rate(stamps: Stamps, stand: Stand) -> None:
    """Refuse rows of another rate than the calibration's: they would look like a standstill.

    Raises
    ------
    RecordingError
        Names both periods.
    """
    period_s, needed_s = float(np.median(np.diff(stamps))) / 1e9, learned(stand).period_s
    if abs(period_s - needed_s) > MOST_APART * needed_s:
        raise RecordingError(
            f"a row comes every {period_s:.4g} s, the calibration of stand {stand.name} is for "
            f"{needed_s:g} s: resample the rows, or calibrate with recordings of this rate"
        )


def row_values(row: Mapping[str, float], stand: Stand) -> tuple[tuple[str, ...], Array]:
    """Channels and values of one row, checked as those of a frame; values have shape (1, n)."""
    _check_names(row, stand, {})
    try:
        values = np.array([[float(value) for value in row.values()]])
    except (TypeError, ValueError):
        name = next(name for name, value in row.items() if not isinstance(value, int | float))
        raise RecordingError(
            f"column {shown(name)} is {shown(row[name])}: give a number, NaN for no reading"
        ) from None
    return tuple(row), values


def _records(
    table: ChannelTable, stamps: Stamps, names: tuple[str, ...], values: Array
) -> Iterator[Record | ScanBlock]:
    yield table
    for first in range(0, len(stamps), BLOCK_ROWS):
        part = slice(first, first + BLOCK_ROWS)
        yield ScanBlock(stamps[part], names, values[part])


def _parts(data: Any) -> tuple[dict[str, Any], Any, Mapping[str, Any]]:
    """Columns, index or None, and attributes, of whatever kind of table it is."""
    pandas, xarray = sys.modules.get("pandas"), sys.modules.get("xarray")
    if pandas is not None and isinstance(data, pandas.DataFrame):
        twice = next((n for n in data.columns if list(data.columns).count(n) > 1), None)
        if twice is not None:
            raise RecordingError(f"two columns are named {shown(twice)}: rename or drop one")
        return {n: data[n].to_numpy() for n in data.columns}, data.index, data.attrs
    if xarray is not None and isinstance(data, xarray.Dataset):
        return _of_dataset(data)
    if isinstance(data, np.ndarray) and data.dtype.names:
        return {name: data[name] for name in data.dtype.names}, None, {}
    if isinstance(data, Mapping):
        attrs = {"units": getattr(data, "units", {}), **getattr(data, "attrs", {})}
        return {str(name): np.asarray(values) for name, values in data.items()}, None, attrs
    raise RecordingError(
        f"{type(data).__name__} is no recording: give a path, an fd.Recording, a pandas.DataFrame, "
        "an xarray.Dataset, or a mapping of channel names to arrays"
    )


def _of_dataset(data: Any) -> tuple[dict[str, Any], Any, Mapping[str, Any]]:
    for name, variable in data.data_vars.items():
        if variable.ndim != 1:
            raise RecordingError(
                f"column {shown(name)} has {variable.ndim} dimensions: give one value a row"
            )
    units = {n: v.attrs["units"] for n, v in data.data_vars.items() if "units" in v.attrs}
    columns = {str(name): variable.to_numpy() for name, variable in data.data_vars.items()}
    along = next(iter(data.dims), None)
    index = data.indexes.get(along)
    return columns, index, {**data.attrs, "units": units}


# --- times -----------------------------------------------------------------------------------


def _stamps(columns: Mapping[str, Any], index: Any, rate_hz: float | None, start_ns: int) -> Stamps:
    """Stamps of the rows in ns, strictly increasing."""
    count = len(index) if index is not None else len(next(iter(columns.values()), ()))
    if count < FEWEST_ROWS:
        raise RecordingError(f"{count} rows: at least {FEWEST_ROWS} are needed")
    if rate_hz is not None:
        if not 0.0 < rate_hz < 1e6:
            raise RecordingError(f"rate_hz = {rate_hz} must be above 0 and below 1 MHz")
        return start_ns + np.round(np.arange(count) * (1e9 / rate_hz)).astype(np.int64)
    name, times = _times(columns, index)
    stamps = _in_ns(name, times, start_ns)
    steps = np.diff(stamps)
    if (steps <= 0).any():
        row = int(np.flatnonzero(steps <= 0)[0]) + 1
        if steps[row - 1] == 0:
            words = "repeats the time of the row before it: drop it, as by "
            remedy = "frame[~frame.index.duplicated()]"
        else:
            words, remedy = "is earlier than the row before it: sort, as by ", "frame.sort_index()"
        raise RecordingError(f"{name}: row {row} ({shown(times[row].item())}) {words}{remedy}")
    return stamps


def _times(columns: Mapping[str, Any], index: Any) -> tuple[str, Any]:
    """Name and values of what says the times of the rows."""
    for name in TIMES:
        if name in columns:
            return f"column {name}", np.asarray(columns[name])
    if index is not None and (index.dtype.kind in "fmM" or index.name in TIMES):
        return f"index {index.name or ''}".strip(), index.to_numpy()
    raise RecordingError(
        f"the rows have no times: name a column {SECONDS} (seconds), set the index to seconds or "
        "to datetimes, or give rate_hz"
    )


def _in_ns(name: str, times: Any, start_ns: int) -> Stamps:
    kind = times.dtype.kind
    if kind not in "mMfiu":
        raise RecordingError(f"{name} is of type {times.dtype}: give seconds or datetimes")
    unknown = np.isnat(times) if kind in "mM" else ~np.isfinite(times)
    if unknown.any():
        row = int(np.flatnonzero(unknown)[0])
        raise RecordingError(f"{name}: row {row} has no time: drop it, every row needs one")
    if kind == "M":
        return np.asarray(times.astype("datetime64[ns]").astype(np.int64))
    if kind == "m":
        return np.asarray(start_ns + times.astype("timedelta64[ns]").astype(np.int64))
    if name.endswith(STAMPS):
        return np.asarray(times.astype(np.int64))
    if np.abs(times).max() > 5e9:
        raise RecordingError(
            f"{name} reaches {np.abs(times).max():g}, more seconds than 150 years: name a column "
            f"of nanoseconds {STAMPS}, or divide it"
        )
    return np.asarray(start_ns + np.round(times * 1e9).astype(np.int64))


# --- columns ---------------------------------------------------------------------------------


def _check_names(read: Mapping[str, Any], stand: Stand, told: Mapping[str, Any]) -> None:
    known = channels_of(stand)
    wrong = next((name for name in read if name not in known and name not in told), None)
    if wrong is None:
        if not read:
            raise RecordingError(f"no column is a channel of stand {stand.name}: {_some(known)}")
        return
    close = get_close_matches(str(wrong), known, 1, 0.6)
    meant = f"rename it if {close[0]} is meant" if close else "drop it if it is none"
    remedy = _other_stand(read, stand) or meant
    raise RecordingError(
        f"column {shown(wrong)} is no channel of stand {stand.name}: {remedy}; its channels are "
        f"{_some(known)}"
    )


def _other_stand(read: Mapping[str, Any], stand: Stand) -> str:
    """The shipped stand that has all of these channels, as a remedy."""
    for name in shipped_stands():
        if set(read) <= set(channels_of(load_stand(name))):
            return f"stand {name} has one, give stand={name!r}"
    return ""


def _some(names: Mapping[str, Any]) -> str:
    return ", ".join(names)


def _numbers(name: str, values: Any, count: int, may_be_empty: bool) -> Array:
    """A column as float64, NaN where nothing was measured.

    A recording may know of a channel that it has no reading of, a frame of one's own may not.
    """
    if values.shape != (count,):
        raise RecordingError(
            f"column {shown(name)} has shape {values.shape}, the rows have ({count},): give one "
            "value a row"
        )
    if values.dtype.kind not in "fiu":
        bad = next((v for v in values.tolist() if not isinstance(v, int | float)), values[0])
        raise RecordingError(
            f"column {shown(name)} is of type {values.dtype}, with {shown(bad)} in it: give "
            "numbers, as by pandas.to_numeric"
        )
    numbers = values.astype(np.float64)
    if np.isinf(numbers).any():
        row = int(np.flatnonzero(np.isinf(numbers))[0])
        raise RecordingError(
            f"column {shown(name)}: row {row} is infinite: give NaN for no reading"
        )
    if np.isnan(numbers).all() and not may_be_empty:
        raise RecordingError(f"column {shown(name)} holds no reading (all NaN): drop it")
    return np.asarray(numbers)


def _info(name: str, unit: str, rate_hz: float, told: Any) -> ChannelInfo:
    if told:
        return ChannelInfo(**{**told, "unit": unit})
    return ChannelInfo(name, unit, -np.inf, np.inf, rate_hz)


def _check_units(rows: tuple[ChannelInfo, ...], known: Mapping[str, str]) -> None:
    for row in rows:
        words = unit_refusal(row.name, row.unit, known)
        if words:
            raise RecordingError(f"column {words.replace('at the source', 'in the frame')}")
