"""What an observer that comes back in mid-run takes over from the last verdict."""

from __future__ import annotations

from typing import NamedTuple

from flea_diag.wire.records import AmbiguityGroup, ChannelTable, UnitOffset


class Takeover(NamedTuple):
    """Offsets of this unit that are known, and the episode that is open (0: none)."""

    offsets: tuple[UnitOffset, ...]
    episode: int
    opened_ns: int


def takeover(
    verdict: AmbiguityGroup | None, table: ChannelTable | None, first_ns: int | None
) -> Takeover | None:
    """What the verdict holds of this run from before its first scan here; None for nothing.

    The channel table marks the start of the run: what is older belongs to another one.
    """
    if verdict is None or table is None or first_ns is None:
        return None
    past = range(table.stamp_ns, first_ns)
    offsets = tuple(offset for offset in verdict.offsets if offset.learned_ns in past)
    episode = verdict.episode if verdict.detected_stamp_ns in past else 0
    return Takeover(offsets, episode, verdict.detected_stamp_ns) if offsets or episode else None
