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

"""Flight logs of PX4 (ULog), by pyulog: topics of their own rates on the rows of all stamps."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from flea_diag.errors import RecordingError, shown
from flea_diag.tools.extra import require
from flea_diag.tools.tables.table import MOST_CELLS, ColumnTable, places
from flea_diag.wire.bags.budget import Budget

TIME = "timestamp_us"
MOST_COLUMNS = 200
_PADDING = ("_padding", "timestamp")


def ulog(
    path: Path, stream: IO[bytes], wanted: Sequence[str] | None, budget: Budget
) -> ColumnTable:
    """Fields as ``topic/field``, empty in the rows of other topics, and ``timestamp_us``.

    Of all fields those of the first topics are read, until there are ``MOST_COLUMNS`` that change.
    """
    require("ulog", str(path))
    from pyulog import ULog

    budget.unpack(stream.seek(0, 2))
    stream.seek(0)
    try:
        log = ULog(stream)
    except Exception as error:  # whatever pyulog makes of damaged bytes
        raise RecordingError(f"{path}: not a ULog file: {shown(str(error))}") from error
    fields = {
        f"{data.name}_{data.multi_id}/{name}": (data.data["timestamp"], values)
        for data in log.data_list
        for name, values in data.data.items()
        if name not in _flags(data) and not name.startswith(_PADDING) and values.dtype.kind in "fiu"
    }
    if wanted is None:
        changing = [n for n, (_, values) in fields.items() if np.ptp(values) > 0]
        names, texts = changing[:MOST_COLUMNS], changing[MOST_COLUMNS:]
    else:
        places(path, wanted, [TIME, *fields])
        names, texts = [name for name in wanted if name != TIME], []
    return _merged(path, {name: fields[name] for name in names}, tuple(texts))


def _flags(data: Any) -> frozenset[str]:
    """Fields that say yes or no: pyulog reads them as numbers."""
    return frozenset(each.field_name for each in data.field_data if each.type_str == "bool")


def _merged(path: Path, fields: dict[str, Any], texts: tuple[str, ...]) -> ColumnTable:
    stamps = [times for times, _ in fields.values()]
    rows: npt.NDArray[Any] = np.unique(np.concatenate(stamps)) if stamps else np.zeros(0)
    if len(rows) * (len(fields) + 1) > MOST_CELLS:
        raise RecordingError(
            f"{path}: {len(fields)} fields with {len(rows)} stamps, at most {MOST_CELLS} cells are "
            "read; cut the log, or convert the topics of the actuator alone (ulog2csv -m TOPIC)"
        )
    columns = {TIME: rows.astype(np.float64)}
    for name, (times, values) in fields.items():
        column = np.full(len(rows), np.nan)
        column[np.searchsorted(rows, times)] = values
        columns[name] = column
    return ColumnTable(columns, {TIME: "us"}, texts)
