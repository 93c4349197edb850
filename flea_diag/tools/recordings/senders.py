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

"""Who sends on a topic: lists of names that change, and a second publisher on the same topic."""

from __future__ import annotations

from collections import Counter
from typing import Any, NamedTuple

from flea_diag.wire.sources.field_path import fields_of

_NAMES = ("name", "joint_names")
MOST_NAMED = 4
ODD = 0.001
"""Share of the messages of a topic below which another sender goes without a word."""


class Signature(NamedTuple):
    """What a message with names says of its sender: names in order, and which arrays it fills."""

    names: tuple[str, ...]
    filled: tuple[str, ...]


def signature_of(message: Any) -> Signature | None:
    """Signature of a JointState or alike; None of messages without a list of names."""
    for key in _NAMES:
        names = getattr(message, key, None)
        if isinstance(names, list) and names and isinstance(names[0], str):
            filled = [f for f in fields_of(message) if f != key and _is_filled(getattr(message, f))]
            return Signature(tuple(names), tuple(filled))
    return None


def _is_filled(value: Any) -> bool:
    return hasattr(value, "__len__") and not isinstance(value, str) and len(value) > 0


class Senders:
    """Signatures of the messages of each topic, counted."""

    def __init__(self) -> None:
        self._counts: dict[str, Counter[Signature | None]] = {}

    def add(self, topic: str, message: Any) -> Signature | None:
        """Count a message."""
        found = signature_of(message)
        self._counts.setdefault(topic, Counter())[found] += 1
        return found

    def left_out(self, topic: str) -> frozenset[Signature | None]:
        """Signatures of senders that say less of the same joints than another."""
        counts = self._counts.get(topic, Counter())
        out = set()
        for one in counts:
            for other in counts:
                if one is None or other is None or not set(one.names) & set(other.names):
                    continue
                if set(one.filled) < set(other.filled):
                    out.add(one)
        return frozenset(out)

    def notes(self, topic: str) -> tuple[str, ...]:
        """What is odd about the senders of a topic, by name."""
        counts = {s: n for s, n in self._counts.get(topic, Counter()).items() if s is not None}
        count = sum(counts.values())
        counts = {s: n for s, n in counts.items() if n > ODD * count}
        out = self.left_out(topic)
        said = [
            f"{topic}: {n} of {count} messages name {_listed(s.names)} with "
            f"{' and '.join(s.filled) or 'nothing'} alone: a second publisher, left out"
            for s, n in counts.items()
            if s in out
        ]
        kept = [s for s in counts if s not in out]
        sets = {frozenset(s.names) for s in kept}
        if len(sets) > 1:
            lists = "; ".join(_listed(tuple(sorted(each))) for each in sorted(sets, key=sorted))
            said.append(f"{topic}: {len(sets)} lists of names in turn, {lists}: each read by name")
        elif len({s.names for s in kept}) > 1:
            said.append(f"{topic}: the order of its names changes: read by name")
        return tuple(said)


def _listed(names: tuple[str, ...]) -> str:
    more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    return ", ".join(names[:MOST_NAMED]) + more
