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

"""Tables as files: CSV, plain or packed, and Parquet."""

from __future__ import annotations

import csv
import gzip
import io
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from flea_diag.errors import ConfigurationError, shown
from flea_diag.tools.extra import require
from flea_diag.tools.terminal import make_folder, writing
from flea_diag.wire.whole_file import replace_file

Columns = Mapping[str, Any]


def save_table(columns: Columns, words: Mapping[str, Any], path: Path) -> Path:
    """Write columns by the suffix of a path, with ``words`` where it can; see ``Table.save``."""
    suffix = next((each for each in WRITERS if path.name.lower().endswith(each)), None)
    if suffix is None:
        raise ConfigurationError(
            f"{path}: {shown(path.suffix)} is no format of a table: name it {', '.join(WRITERS)}"
        )
    content = WRITERS[suffix](columns, words)
    make_folder(path.parent)
    with writing(path):
        replace_file(path, content)
    return path


def _csv(columns: Columns, words: Mapping[str, Any]) -> bytes:
    text = io.StringIO()
    write = csv.writer(text, lineterminator="\n")
    write.writerow(columns)
    write.writerows(zip(*(_texts(values) for values in columns.values()), strict=True))
    return text.getvalue().encode()


def _texts(values: Any) -> list[Any]:
    """Cells of a column: numbers as their shortest exact text, nothing for NaN."""
    if values.dtype.kind != "f":
        return list(values.tolist())
    return ["" if value != value else repr(value) for value in values.tolist()]


def _packed(columns: Columns, words: Mapping[str, Any]) -> bytes:
    return gzip.compress(_csv(columns, words), mtime=0)


def _parquet(columns: Columns, words: Mapping[str, Any]) -> bytes:
    require("parquet", "a Parquet file")
    import pyarrow
    from pyarrow import parquet

    arrays = {
        name: pyarrow.array([str(cell) for cell in values] if values.dtype == object else values)
        for name, values in columns.items()
    }
    made = pyarrow.table(arrays)
    made = made.replace_schema_metadata({"flea_diag": json.dumps(words, default=_plain)})
    sink = io.BytesIO()
    parquet.write_table(made, sink)
    return sink.getvalue()


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else str(value)


WRITERS: dict[str, Callable[[Columns, Mapping[str, Any]], bytes]] = {
    ".csv": _csv,
    ".csv.gz": _packed,
    ".parquet": _parquet,
}
"""End of a file's name -> its content."""
