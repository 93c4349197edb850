"""Digest of a diagnosis: equal for equal input, configuration and numeric backend.

SHA-256 over what was decided: Detection, Symbols, FeatureRequest, FeatureValue without its
measured cost, and every change of AmbiguityGroup. Left out is what two runs of the same
diagnosis may differ in: the repeats once a second, their numbers, whether the source was
silent just then, whether it was live or a replay; and what decides nothing: advice, words on
what opened an episode, offsets kept for an observer that comes back, counters of samples. Each
kind keeps its own order and the kinds follow one another in the rank of their topics, so that
records of several topics may arrive interleaved in any way.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterable
from dataclasses import asdict
from typing import Any

from flea_diag.wire.records import (
    AmbiguityGroup,
    Detection,
    FeatureRequest,
    FeatureValue,
    Record,
    Symbols,
)

LEFT_OUT: dict[type, tuple[str, ...]] = {
    Detection: (),
    Symbols: (),
    FeatureRequest: (),
    FeatureValue: ("cost_ms",),
    AmbiguityGroup: ("seq", "source", "stale", "next_tests", "opened_by", "offsets", "counters"),
}
"""Decisions in the rank of their topics -> fields that are not part of the decision."""

DECISIONS = tuple(LEFT_OUT)


class Digest:
    """Take records one by one; ``hexdigest`` at any time."""

    def __init__(self) -> None:
        self._lines: dict[type, list[str]] = {kind: [] for kind in DECISIONS}

    def add(self, record: Record) -> None:
        """Take one record; one that is no decision, or repeats the last group, adds nothing."""
        lines = self._lines.get(type(record))
        if lines is None:
            return
        line = canonical(record)
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


def canonical(record: Record) -> str:
    """Canonical JSON of a decision: sorted keys, no blanks, numbers as ``repr`` writes them."""
    content = asdict(record)
    for name in LEFT_OUT[type(record)]:
        del content[name]
    content["record"] = type(record).__name__
    return json.dumps(_plain(content), sort_keys=True, separators=(",", ":"), allow_nan=False)


def _plain(value: Any) -> Any:
    """JSON knows no NaN and no infinities: they go as words."""
    if isinstance(value, float) and not math.isfinite(value):
        return repr(float(value))
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, (tuple, list)):
        return [_plain(item) for item in value]
    return value
