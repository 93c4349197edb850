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

"""The verdict as published: on every change, repeated every second, STALE when the source stops.

A console that joins late, or lost a message, is up to date within a second. What goes out is a
summary; the hypotheses behind it are a latched record, published once per verdict.
"""

from __future__ import annotations

from dataclasses import replace

from flea_diag.wire.messages.summary import summary
from flea_diag.wire.messages.verdict_numbers import verdict_numbers
from flea_diag.wire.records import AmbiguityGroup, Record, Verdict


class NumberedVerdict:
    """The latest ambiguity group; ``seq`` increases with every publication."""

    def __init__(self) -> None:
        self._group: AmbiguityGroup | None = None
        self._seq = 0
        self._published: tuple[Verdict, str] | None = None
        """Verdict and words of the latest hypotheses that went out."""

    def changed(self, group: AmbiguityGroup, silent: bool = False) -> AmbiguityGroup:
        """Number a new group; it is stale when its source has already stopped."""
        self._group = replace(group, stale=silent)
        return self._numbered(self._group)

    def forget(self) -> None:
        """Forget the group of the previous run; ``seq`` continues."""
        self._group = None

    def again(self) -> AmbiguityGroup | None:
        """The latest group with the next number; None before the first group."""
        return None if self._group is None else self._numbered(self._group)

    def source_silent(self, silent: bool) -> AmbiguityGroup | None:
        """Group to publish at once because its source has stopped or resumed, else None."""
        if self._group is None or self._group.stale == silent:
            return None
        self._group = replace(self._group, stale=silent)
        return self._numbered(self._group)

    def messages(self, group: AmbiguityGroup, stand: str) -> tuple[Record, ...]:
        """Records to publish for a group: its hypotheses if new, its summary, its numbers."""
        brief, numbers = summary(group, stand), verdict_numbers(group)
        verdict = group.verdict, group.words
        if verdict == self._published:
            return brief, numbers
        self._published = verdict
        return group.hypotheses(), brief, numbers

    def _numbered(self, group: AmbiguityGroup) -> AmbiguityGroup:
        self._seq += 1
        return replace(group, seq=self._seq)
