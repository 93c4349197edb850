"""A verdict of a baseline: members and words, no evidence, no course of an episode."""

from __future__ import annotations

from flea_diag.wire.records import NEVER_NS, AmbiguityGroup, Candidate, Outcome


def plain_verdict(
    stamp_ns: int,
    outcome: Outcome,
    words: str,
    members: tuple[Candidate, ...] = (),
    detected_ns: int = NEVER_NS,
    features: tuple[str, ...] = (),
) -> AmbiguityGroup:
    """Verdict of a replay; ``features`` are those that had to be computed for it."""
    return AmbiguityGroup(
        stamp_ns=stamp_ns,
        outcome=outcome,
        episode=1 if members else 0,
        step=0,
        seq=0,
        members=members,
        dropped=(),
        detected_stamp_ns=detected_ns,
        words=words,
        calibration_sha256="",
        source="replay",
        features_computed=features,
        features_available=len(features),
    )
