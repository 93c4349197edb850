"""Interface through which operators inject faults into a simulated stand."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol


class FaultEntry(Protocol):
    """Accepts faults while ``present``."""

    present: bool

    def set(self, value: str, told: Callable[[str], None]) -> None:
        """Inject a fault ('' clears all); ``told`` is called with the reason of a refusal or ''."""


class NoFaults:
    """A stand that accepts no faults."""

    present = False

    def set(self, value: str, told: Callable[[str], None]) -> None:
        """Refuse."""
        told("no simulated stand is running")
