"""Status of the stand on /diagnostics, for rqt_robot_monitor and diagnostic_aggregator.

Repeats the verdict and the state of the channels, which have topics of their own, once a second
and on every change. No node of ours reads it. Names are ``NODE: verdict`` and ``NODE: channels``
(REP-107), beside ``NODE`` for the health of the node itself.
"""

from __future__ import annotations

from flea_diag.wire.messages.summary import summary
from flea_diag.wire.records import AmbiguityGroup, DataQuality, Health, Record
from flea_diag.wire.wording import words_of

MIRRORED: tuple[type, ...] = (AmbiguityGroup, DataQuality)


def mirrored(record: AmbiguityGroup | DataQuality, node: str, now_ns: int) -> Health:
    """Diagnostic status with the content of a record of one of the ``MIRRORED`` types."""
    if isinstance(record, DataQuality):
        return _status(record, f"{node}: channels", now_ns, _of_channels(record))
    brief = summary(record)
    return _status(brief, f"{node}: verdict", now_ns, _of_group(brief))


def _status(record: Record, name: str, now_ns: int, values: tuple[tuple[str, str], ...]) -> Health:
    words = words_of(record)
    return Health(now_ns, name, words.level, words.message, values)


def _of_group(group: AmbiguityGroup) -> tuple[tuple[str, str], ...]:
    members = tuple(
        (f"possible/{c.fault}", f"probability {c.probability:.3g}: {c.reason}")
        for c in group.members
        if c.reason
    )
    return (
        ("outcome", group.outcome.value),
        ("episode", str(group.episode)),
        ("source", group.source),
        ("members", ", ".join(c.fault for c in group.members)),
        *members,
    )


def _of_channels(quality: DataQuality) -> tuple[tuple[str, str], ...]:
    return tuple(
        (row.channel, f"{row.quality.value}: {row.reason}" if row.reason else row.quality.value)
        for row in quality.channels
    )
