"""Where people put faults into a stand: a simulated one alone has such a place."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol


class FaultEntry(Protocol):
    """Takes faults while ``present``."""

    present: bool

    def set(self, value: str, told: Callable[[str], None]) -> None:
        """Put a fault in ('' clears all); ``told`` hears why it could not be, or ""."""


class NoFaults:
    """A stand that takes none."""

    present = False

    def set(self, value: str, told: Callable[[str], None]) -> None:
        """Say so."""
        told("no simulated stand is here")
