"""The verdict as published: on every change, repeated every second, STALE when the source stops.

A console that joins late, or lost a message, is up to date within a second.
"""

from __future__ import annotations

from dataclasses import replace

from flea_diag.wire.records import AmbiguityGroup


class NumberedVerdict:
    """The latest ambiguity group; ``seq`` increases with every publication."""

    def __init__(self) -> None:
        self._group: AmbiguityGroup | None = None
        self._seq = 0

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

    def _numbered(self, group: AmbiguityGroup) -> AmbiguityGroup:
        self._seq += 1
        return replace(group, seq=self._seq)
