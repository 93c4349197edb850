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

"""Kept results: small JSON files from which the tables of docs/results are made.

One file is one table. A row is a share (``right`` of ``count``), a rate (``events`` in
``hours``), a value with its unit, or words that were stated (``text``); what a row does not say
of its origin the file says for all of its rows.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path

SCHEMA_VERSION = 1
ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "docs" / "results" / "kept"


@dataclass(frozen=True)
class Origin:
    """When and from what a figure was measured.

    ``developed_on`` names the runs that the method was tuned on, ``scored_on`` those behind
    the figure. ``commit`` is that of the source, or of the text that stated the figure.
    """

    date: str = ""
    commit: str = ""
    seed: str = ""
    developed_on: str = ""
    scored_on: str = ""


@dataclass(frozen=True)
class KeptRow:
    """One row of a table; ``cells`` are further columns in words, ``origin`` its own origin."""

    name: str
    right: int | None = None
    count: int | None = None
    events: int | None = None
    hours: float | None = None
    value: float | None = None
    unit: str = ""
    text: str = ""
    n: str = ""
    low: float | None = None
    high: float | None = None
    against: str = ""
    cells: Mapping[str, str] = field(default_factory=dict)
    origin: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class KeptResult:
    """One table. ``carried_over``: stated earlier and not measured anew at this state."""

    title: str
    made_by: str
    origin: Origin
    rows: tuple[KeptRow, ...]
    carried_over: bool = False
    machine: str = ""
    notes: tuple[str, ...] = ()
    schema_version: int = SCHEMA_VERSION

    def origin_of(self, row: KeptRow) -> Origin:
        """Origin of one row: its own words first, else those of the file."""
        return Origin(**{**asdict(self.origin), **row.origin})


def read_kept(path: Path) -> KeptResult:
    """The table in a file.

    Raises
    ------
    ValueError
        Naming the file and what is wrong with it.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise ValueError(f"{path}: cannot be read as JSON: {error}") from error
    found = content.get("schema_version")
    if found != SCHEMA_VERSION:
        raise ValueError(f"{path}: schema_version is {found!r}, must be {SCHEMA_VERSION}")
    try:
        rows = tuple(KeptRow(**row) for row in content.pop("rows"))
        kept = KeptResult(**{**content, "rows": rows, "notes": tuple(content.get("notes", ())),
                       "origin": Origin(**content["origin"])})  # fmt: skip
        for row in rows:
            kept.origin_of(row)
    except (KeyError, TypeError) as error:
        raise ValueError(f"{path}: {error}; keep it anew with scripts/keep") from error
    return kept


def write_kept(path: Path, kept: KeptResult) -> None:
    """Write a table; what is empty is left out."""
    empty = {each.name: each.default for each in fields(KeptRow)}
    rows = [
        {key: value for key, value in asdict(row).items() if value not in ({}, empty.get(key))}
        for row in kept.rows
    ]
    content = {"schema_version": kept.schema_version, **asdict(kept), "rows": rows}
    path.parent.mkdir(parents=True, exist_ok=True)
    text = json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False)
    path.write_text(text + "\n", encoding="utf-8")
