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

"""Digest of a diagnosis: equal for equal input, configuration and numeric backend.

SHA-256 over what was decided: Detection, Symbols, FeatureRequest, FeatureValue without its
measured cost, and every change of AmbiguityGroup. Left out is what two runs of the same
diagnosis may differ in: the repeats once a second, their numbers, whether the source was
silent just then, whether it was live or a replay; and what decides nothing: advice, words on
what opened an episode, numbers that its words hold, the promise of the calibration, offsets kept
for an observer that comes back, counters of samples. Each kind keeps its own order and the kinds
follow one another in the rank of their topics, so that records of several topics may arrive
interleaved in any way.

The decision digest is the same over fewer fields: outcome, members, sizes, symbols, features
and their stamps. Prose, evidence texts and hashes of files are not in it, so that a change of
wording keeps it and a change of what is decided does not.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Iterable
from dataclasses import fields, is_dataclass
from typing import Any

from flea_diag.wire.records import (
    AmbiguityGroup,
    Candidate,
    Detection,
    FeatureRequest,
    FeatureValue,
    Record,
    Symbols,
)

LEFT_OUT: dict[type, tuple[str, ...]] = {
    Detection: ("onsets",),
    Symbols: (),
    FeatureRequest: (),
    FeatureValue: ("cost_ms",),
    AmbiguityGroup: (
        "seq", "source", "stale", "next_tests", "opened_by", "offsets", "counters", "summary",
        "dropped_count", "not_observable_count", "stated_false_alarms_per_hour",
        "supported_false_alarms_per_hour", "to_do", "shows_from", "looked_for", "pairs",
        "comes_and_goes",
    ),
}  # fmt: skip
"""Decisions in the rank of their topics -> fields that are not part of the decision."""

DECISIONS = tuple(LEFT_OUT)

LEFT_OUT_WITHIN: dict[type, tuple[str, ...]] = {Candidate: ("size_sigma_own",)}
"""The same of what decisions hold: how an error splits that is in them as a whole."""

OF_A_MEMBER = ("fault", "probability", "size", "size_sigma")
DECIDED: dict[type, tuple[str, ...]] = {
    Detection: ("stamp_ns", "episode", "detected", "residual", "z", "threshold"),
    Symbols: ("stamp_ns", "episode", "symbols"),
    FeatureRequest: (
        "stamp_ns", "episode", "step", "feature", "window_start_ns", "window_end_ns",
    ),
    FeatureValue: (
        "stamp_ns", "episode", "step", "feature", "window_start_ns", "window_end_ns",
        "value", "symbol", "nominal_low", "nominal_high",
    ),
    AmbiguityGroup: ("stamp_ns", "outcome", "episode", "step", "detected_stamp_ns"),
}  # fmt: skip
"""Decisions -> fields of the decision digest; those of a group go through `decided` as well."""


class Digest:
    """Take records one by one; ``hexdigest`` at any time.

    Parameters
    ----------
    line
        Canonical line of a decision: ``canonical``, or ``decided`` for the decision digest.
    """

    def __init__(self, line: Callable[[Record], str] | None = None) -> None:
        self._line = line or canonical
        self._lines: dict[type, list[str]] = {kind: [] for kind in DECISIONS}

    def add(self, record: Record) -> None:
        """Take one record; one that is no decision, or repeats the last group, adds nothing."""
        lines = self._lines.get(type(record))
        if lines is None:
            return
        line = self._line(record)
        if not isinstance(record, AmbiguityGroup) or lines[-1:] != [line]:
            lines.append(line)

    def hexdigest(self) -> str:
        """SHA-256 of the decisions so far."""
        sha = hashlib.sha256()
        for lines in self._lines.values():
            for line in lines:
                sha.update(line.encode() + b"\n")
        return sha.hexdigest()


def digest(records: Iterable[Record]) -> str:
    """Digest of a whole diagnosis."""
    whole = Digest()
    for record in records:
        whole.add(record)
    return whole.hexdigest()


def decision_digest(records: Iterable[Record]) -> str:
    """Decision digest of a whole diagnosis."""
    whole = Digest(decided)
    for record in records:
        whole.add(record)
    return whole.hexdigest()


def canonical(record: Record) -> str:
    """Canonical JSON of a decision: sorted keys, no blanks, numbers as ``repr`` writes them."""
    left_out = LEFT_OUT[type(record)]
    return _line(record, [field.name for field in fields(record) if field.name not in left_out])


def decided(record: Record) -> str:
    """Canonical JSON of what was decided, without the words it was said in."""
    names = DECIDED[type(record)]
    if not isinstance(record, AmbiguityGroup):
        return _line(record, names)
    members = [{name: getattr(m, name) for name in OF_A_MEMBER} for m in record.members]
    hidden = [fault for fault, _ in record.not_observable]
    return _line(record, names, members=members, not_observable=hidden)


def _line(record: Record, names: Iterable[str], **derived: Any) -> str:
    content = {name: getattr(record, name) for name in names}
    content |= {**derived, "record": type(record).__name__}
    return json.dumps(_plain(content), sort_keys=True, separators=(",", ":"), allow_nan=False)


def _plain(value: Any) -> Any:
    """Records as mappings; JSON knows no NaN and no infinities: they go as words."""
    if isinstance(value, float):
        return value if math.isfinite(value) else repr(float(value))
    if isinstance(value, (str, int)):
        return value
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, (tuple, list)):
        return [_plain(item) for item in value]
    if is_dataclass(value):
        left_out = LEFT_OUT_WITHIN.get(type(value), ())
        names = [field.name for field in fields(value) if field.name not in left_out]
        return {name: _plain(getattr(value, name)) for name in names}
    return value
