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

"""Named columns of one length: what every public function returns numbers in."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from flea_diag.api.table_file import save_table
from flea_diag.tools.extra import require

SHOWN_ROWS = 6
"""Of a table in a notebook: half of them from its beginning, half from its end."""


@dataclass(frozen=True, eq=False, repr=False)
class Table(Mapping[str, npt.NDArray[Any]]):
    """Columns by name; a mapping of numpy arrays, and a pandas or xarray object on request.

    Parameters
    ----------
    columns
        Name -> array of shape (n,): float64, or object for words.
    index
        The column that orders the rows, ``time_s`` in most tables (seconds from the first scan).
    units
        Name -> unit, as far as a column has one (SI, temperatures in degC).
    attrs
        What holds for the whole table, such as ``start_ns``: the stamp of its first scan in
        nanoseconds since 1970. Passed on to frames and datasets, from which ``fd.diagnose``
        reads it back.
    """

    columns: Mapping[str, npt.NDArray[Any]]
    index: str = "time_s"
    units: Mapping[str, str] = field(default_factory=dict)
    attrs: Mapping[str, Any] = field(default_factory=dict)

    def __getitem__(self, name: str) -> npt.NDArray[Any]:
        """One column, shape (n,)."""
        return self.columns[name]

    def __iter__(self) -> Iterator[str]:
        """Names of the columns."""
        return iter(self.columns)

    def __len__(self) -> int:
        """Number of columns, as of any mapping; ``rows`` is the other one."""
        return len(self.columns)

    @property
    def rows(self) -> int:
        """Number of rows."""
        return len(next(iter(self.columns.values()), ()))

    def frame(self) -> Any:
        """The table as a ``pandas.DataFrame`` whose index is ``index``.

        Its ``attrs`` hold ``units`` and whatever else is known of all rows.

        Raises
        ------
        ConfigurationError
            pandas is not installed; the message has the command.
        """
        require("frames", "a data frame")
        import pandas as pd

        rest = {name: values for name, values in self.columns.items() if name != self.index}
        frame = pd.DataFrame(rest, index=pd.Index(self.columns[self.index], name=self.index))
        frame.attrs = {**self.attrs, "units": dict(self.units)}
        return frame

    def dataset(self) -> Any:
        """The table as an ``xarray.Dataset`` along its index; each variable has its ``units``.

        Raises
        ------
        ConfigurationError
            xarray is not installed; the message has the command.
        """
        require("frames", "a dataset")
        import xarray as xr

        rest = {
            name: (self.index, values, {"units": self.units[name]} if name in self.units else {})
            for name, values in self.columns.items()
            if name != self.index
        }
        return xr.Dataset(rest, {self.index: self.columns[self.index]}, dict(self.attrs))

    def save(self, path: str | Path) -> Path:
        """Write the table to a CSV (``.csv``, ``.csv.gz``) or Parquet (``.parquet``) file.

        CSV numbers read back to the same bits. Parquet keeps units and attributes as metadata.

        Raises
        ------
        ConfigurationError
            The suffix is none of these, or the file cannot be written.
        """
        return save_table(self.columns, {**self.attrs, "units": dict(self.units)}, Path(path))

    def __repr__(self) -> str:
        """Size and names in one line."""
        return f"Table of {self.rows} rows: {', '.join(self.columns)}"

    def _repr_html_(self) -> str:
        """First and last rows, for a notebook."""
        half = SHOWN_ROWS // 2
        rows = range(self.rows)
        cut = self.rows > SHOWN_ROWS
        chosen = [*rows[:half], *rows[-half:]] if cut else [*rows]
        lines = [
            "<tr>" + "".join(f"<td>{_cell(v[k])}</td>" for v in self.columns.values()) + "</tr>"
            for k in chosen
        ]
        if cut:
            lines.insert(half, "<tr>" + "<td>…</td>" * len(self.columns) + "</tr>")
        heads = "".join(f"<th>{_head(name, self.units)}</th>" for name in self.columns)
        body = "".join(lines)
        return f"<table><tr>{heads}</tr>{body}</table><p>{self.rows} rows</p>"


def _head(name: str, units: Mapping[str, str]) -> str:
    unit = units.get(name, "")
    return escape(f"{name} [{unit}]" if unit else name)


def _cell(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float | np.floating) else escape(str(value))
