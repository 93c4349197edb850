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

"""The tables of a diagnosis: residuals, verdicts, evidence."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np

from flea_diag.api.table import Table
from flea_diag.errors import ConfigurationError
from flea_diag.wire.blocks import ResidualBlock
from flea_diag.wire.records import NEVER_NS, AmbiguityGroup


class Told(NamedTuple):
    """What was said in a diagnosis, and of which recording."""

    name: str
    start_ns: int
    groups: tuple[AmbiguityGroup, ...]
    blocks: tuple[ResidualBlock, ...]


WORDS, NUMBER = object, np.float64
VERDICT = {
    "time_s": NUMBER,
    "outcome": WORDS,
    "episode": NUMBER,
    "members": WORDS,
    "probabilities": WORDS,
    "words": WORDS,
}
EVIDENCE = {
    "time_s": NUMBER,
    "episode": NUMBER,
    "fault": WORDS,
    "possible": NUMBER,
    "source": WORDS,
    "observed": WORDS,
    "predicted": WORDS,
    "verdict": WORDS,
    "reason": WORDS,
}
"""Columns of a table and what they hold."""


def residuals(of: Told) -> Table:
    """Residuals with z and limits over time; see ``Diagnosis.residuals``."""
    if not of.blocks:
        raise ConfigurationError(
            f"{of.name}: no residuals were kept: diagnose with residuals=True (they take 2 kB a "
            "row); of a recording shorter than the smoothing there are none"
        )
    names = dict.fromkeys(name for block in of.blocks for name in block.names)
    stamps = np.concatenate([block.stamps_ns for block in of.blocks])
    columns: dict[str, Any] = {"time_s": (stamps - of.start_ns) / 1e9}
    for name in names:
        for end, part in (("", "values"), ("/z", "z"), ("/limit", "thresholds")):
            columns[f"{name}{end}"] = np.concatenate(
                [_column(getattr(block, part), block.names, name) for block in of.blocks]
            )
    return Table(columns, attrs={"recording": of.name, "start_ns": of.start_ns})


def _column(values: Any, names: tuple[str, ...], name: str) -> Any:
    if name not in names:
        return np.full(len(values), np.nan)
    return values[:, names.index(name)]


def verdicts(of: Told) -> Table:
    """One row for each change of outcome, members or probabilities."""
    return _table(VERDICT, _verdict_rows(of), of)


def _verdict_rows(of: Told) -> Iterator[tuple[Any, ...]]:
    before: tuple[Any, ...] = ()
    for group in of.groups:
        row = (
            group.outcome.value,
            group.episode,
            " ".join(member.fault for member in group.members),
            " ".join(f"{member.probability:.6g}" for member in group.members),
            group.words,
        )
        if row[:-1] != before:
            before = row[:-1]
            yield seconds(group.stamp_ns, of.start_ns), *row


def evidence(of: Told) -> Table:
    """One row for each observation on each fault, of the last verdict of each episode."""
    last = {group.episode: group for group in of.groups if group.episode > 0}
    return _table(EVIDENCE, (r for group in last.values() for r in _evidence_rows(of, group)), of)


def _evidence_rows(of: Told, group: AmbiguityGroup) -> Iterator[tuple[Any, ...]]:
    for kept, candidates in ((1.0, group.members), (0.0, group.dropped)):
        for row in candidates:
            for each in row.evidence:
                at_s = seconds(each.stamp_ns, of.start_ns)
                said = each.source, each.observed, each.predicted, each.verdict
                yield at_s, group.episode, row.fault, kept, *said, row.reason
            if not row.evidence:
                at_s = seconds(group.stamp_ns, of.start_ns)
                yield at_s, group.episode, row.fault, kept, "", "", "", "", row.reason


def _table(kinds: dict[str, Any], rows: Iterable[tuple[Any, ...]], of: Told) -> Table:
    found = list(rows)
    columns = {
        name: np.array([row[place] for row in found], dtype=kind)
        for place, (name, kind) in enumerate(kinds.items())
    }
    return Table(columns, attrs={"recording": of.name, "start_ns": of.start_ns})


def seconds(stamp_ns: int, start_ns: int) -> float:
    """Seconds after the first scan; NaN for what never was."""
    return float("nan") if stamp_ns == NEVER_NS else (stamp_ns - start_ns) / 1e9
