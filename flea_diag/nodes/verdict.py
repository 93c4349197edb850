"""The verdict as it goes out: on every change, again each second, STALE when the source stops.

A console that joins late, or lost one message, is right within a second.
"""

from __future__ import annotations

from dataclasses import replace

from flea_diag.wire.records import AmbiguityGroup


class NumberedVerdict:
    """The last ambiguity group, numbered: ``seq`` grows with every publication."""

    def __init__(self) -> None:
        self._group: AmbiguityGroup | None = None
        self._seq = 0

    def changed(self, group: AmbiguityGroup, silent: bool = False) -> AmbiguityGroup:
        """Number a new group; it is stale when it came of the last records of a silent source."""
        self._group = replace(group, stale=silent)
        return self._numbered(self._group)

    def forget(self) -> None:
        """Repeat nothing of the run before; numbers go on growing."""
        self._group = None

    def again(self) -> AmbiguityGroup | None:
        """The last group with the next number, or None before there is one."""
        return None if self._group is None else self._numbered(self._group)

    def source_silent(self, silent: bool) -> AmbiguityGroup | None:
        """Group to publish at once because its source stopped or came back, or None."""
        if self._group is None or self._group.stale == silent:
            return None
        self._group = replace(self._group, stale=silent)
        return self._numbered(self._group)

    def _numbered(self, group: AmbiguityGroup) -> AmbiguityGroup:
        self._seq += 1
        return replace(group, seq=self._seq)
