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

"""Ratings of severity and occurrence that a user gives, 1 to 10 each, as IEC 60812 has them."""

from __future__ import annotations

import csv
import io
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from flea_diag.errors import ConfigurationError, question, shown
from flea_diag.fields.reader import read_as
from flea_diag.fields.values import within
from flea_diag.wire.regular_file import read_text
from flea_diag.wire.yaml_text import parse_yaml

FILE_LIMIT_BYTES = 1 << 20
COLUMNS = ("severity", "occurrence")
Rated = Annotated[int, within(1, 10)]


@dataclass(frozen=True)
class Rating:
    """Of one fault; None is not rated."""

    severity: Rated | None = None
    occurrence: Rated | None = None


def load_ratings(path: Path, known: Collection[str]) -> dict[str, Rating]:
    """Ratings by fault, from YAML or CSV.

    YAML has ``jam: {severity: 8, occurrence: 3}``, a CSV the columns fault, severity, occurrence.

    Raises
    ------
    ConfigurationError
        The file cannot be read, a fault is unknown, or a rating is no whole number from 1 to 10.
    """
    try:
        text = read_text(path, FILE_LIMIT_BYTES, ConfigurationError)
        content = _table(text) if path.suffix == ".csv" else parse_yaml(text) or {}
    except OSError as error:
        raise ConfigurationError(f"{path}: cannot be read: {error}") from error
    except ValueError as error:
        raise ConfigurationError(f"{path}: neither YAML nor a table: {error}") from error
    ratings = read_as(dict[str, Rating], content, str(path))
    for name in ratings:
        if name not in known:
            raise ConfigurationError(
                f"{path}: {shown(name)} is no fault of the stand{question(name, known)}"
            )
    return ratings


def _table(text: str) -> Mapping[str, Any]:
    """The same from a CSV; an empty cell is not rated."""
    rows = csv.DictReader(io.StringIO(text))
    if not {"fault", *COLUMNS} <= set(rows.fieldnames or ()):
        raise ValueError(f"the columns must be fault, {', '.join(COLUMNS)}")
    return {
        row["fault"]: {
            key: int(row[key]) if (row[key] or "").isdecimal() else row[key]
            for key in COLUMNS
            if row[key]
        }
        for row in rows
    }
