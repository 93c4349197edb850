"""What judging every nominal recording without itself has shown; kept with the calibration."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class OutOfSample:
    """How near recordings came to a false alarm, by limits learned without them.

    ``largest`` is the largest statistic over its limit, ``alarms`` the number of recordings at 1 or
    beyond, ``widening`` the largest factor of a limit that the tail of its scores asked for.
    """

    recordings: int
    alarms: int
    largest: float
    widening: float


@dataclass(frozen=True, slots=True)
class LeftOut:
    """A recording that was given as nominal and that the others show not to be."""

    recording: str
    reason: str
