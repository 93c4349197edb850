"""Progress of the first start after an installation, in which numba compiles."""

from __future__ import annotations

from typing import Any

from flea_diag.wire.bus import Bus


class CompileProgress:
    """Counts functions whose compilation begins, as what the node is doing.

    Parameters
    ----------
    bus
        Bus of the node, which says it every few seconds.
    """

    def __init__(self, bus: Bus[Any]) -> None:
        self._bus = bus
        self._functions = 0

    def __call__(self, name: str) -> None:
        """Note that ``name`` is being compiled."""
        self._functions += 1
        self._bus.doing = (
            f"compiling {name}, function {self._functions}; later starts take them from disk"
        )
