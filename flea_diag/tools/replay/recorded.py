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

"""Decisions that a bag holds already: its verdicts, completed by the hypotheses beside them."""

from __future__ import annotations

from collections.abc import Iterable

from flea_diag.stages.digest import DECISIONS, Digest, canonical, decided
from flea_diag.wire.records import AmbiguityGroup, Hypotheses, Record

RECORDED: tuple[type, ...] = (*DECISIONS, Hypotheses)
"""Record types of a recorded diagnosis."""


def completed(records: Iterable[Record]) -> list[Record]:
    """Recorded records in their order, each summary with its hypotheses, where the bag has them.

    The two are separate topics: either may have been recorded first.
    """
    whole = list(records)
    found = {each.verdict: each for each in whole if isinstance(each, Hypotheses)}
    return [
        each.with_hypotheses(found.get(each.verdict)) if isinstance(each, AmbiguityGroup) else each
        for each in whole
        if not isinstance(each, Hypotheses)
    ]


class RecordedDecisions:
    """Digests of the diagnosis in a bag; take its records one by one."""

    def __init__(self) -> None:
        self._kept: list[Record] = []
        self._last = ""
        self._published = False

    def add(self, record: Record) -> None:
        """Take one record; a repeated verdict adds nothing."""
        if isinstance(record, AmbiguityGroup):
            self._published = True
            line = f"{canonical(record)} {record.dropped_count}"
            if line == self._last:
                return
            self._last = line
        self._kept.append(record)

    def digests(self) -> dict[str, str | None]:
        """Both digests; None where the bag holds no verdicts, or only their summaries."""
        records = completed(self._kept)
        groups = [record for record in records if isinstance(record, AmbiguityGroup)]
        lacking = not self._published or any(group.summary for group in groups)
        return {
            name: None if lacking else _hex(Digest(line), records)
            for name, line in (
                ("recorded_digest", canonical),
                ("recorded_decision_digest", decided),
            )
        }


def _hex(digest: Digest, records: Iterable[Record]) -> str:
    for record in records:
        digest.add(record)
    return digest.hexdigest()
