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

"""The rules of diagnostic_aggregator (ROS 2 Jazzy), which the wheels of ROS do not have.

Written from its documented behaviour: which branch takes a status (``GenericAnalyzer``), how levels
roll up (``GenericAnalyzerBase``, ``AnalyzerGroup``), what is stale, and where the rest goes
(``OtherAnalyzer``). Times are those of receipt, in seconds of any clock.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

OK, WARN, ERROR, STALE = range(4)
KNOWN = {"type", "path", "timeout", "num_items", "discard_stale",
         "regex", "expected", "name", "startswith", "contains"}  # fmt: skip


@dataclass
class _Branch:
    """One analyzer: what it takes, and the latest status of each name with its time."""

    row: Mapping[str, Any]
    items: dict[str, tuple[int, float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        unknown = set(self.row) - KNOWN
        assert not unknown, f"the aggregator ignores {unknown}"
        assert any(
            key in self.row for key in ("regex", "expected", "name", "startswith", "contains")
        )

    def matches(self, name: str) -> bool:
        row = self.row
        return (
            any(re.fullmatch(pattern, name) for pattern in row.get("regex", ()))
            or name in (*row.get("expected", ()), *row.get("name", ()))
            or name.startswith(tuple(row.get("startswith", ())))
            or any(part in name for part in row.get("contains", ()))
        )

    def level(self, now_s: float) -> int:
        """Level of the header of this branch; stale items are discarded where that is asked for."""
        timeout_s, expected = self.row.get("timeout", 5.0), self.row.get("num_items", -1)
        stale = {name: now_s - at_s > timeout_s for name, (_, at_s) in self.items.items()}
        if self.row.get("discard_stale", False):
            self.items = {name: item for name, item in self.items.items() if not stale[name]}
        level, all_stale = OK, True
        for name, (own, _) in sorted(self.items.items()):
            level = STALE if stale[name] else max(level, own)
            all_stale = all_stale and (own == STALE or stale[name])
        if all_stale:
            level = STALE
        elif level == STALE:
            level = ERROR
        if expected == 0 and not self.items:
            level = OK
        elif expected > 0 and len(self.items) != expected:
            level = max(level, ERROR)
        return level


class Aggregator:
    """A tree of branches below one root, as its parameter file says."""

    def __init__(self, path: Path) -> None:
        (node,) = yaml.safe_load(path.read_text(encoding="utf-8")).values()
        rows = {k: v for k, v in node["ros__parameters"].items() if isinstance(v, dict)}
        self.root = node["ros__parameters"]["path"]
        self._branches = {row["path"]: _Branch(row) for row in rows.values()}
        self.other: set[str] = set()
        """Names that no branch takes."""

    def take(self, name: str, level: int, now_s: float) -> None:
        """One status of a message on /diagnostics."""
        took = [branch for branch in self._branches.values() if branch.matches(name)]
        for branch in took:
            branch.items[name] = (level, now_s)
        if not took:
            self.other.add(name)

    def levels(self, now_s: float) -> dict[str, int]:
        """Level of each branch, and of the root by its name."""
        found = {path: branch.level(now_s) for path, branch in self._branches.items()}
        worst = max(found.values())
        stale = all(level == STALE for level in found.values())
        return {**found, self.root: ERROR if worst == STALE and not stale else worst}
