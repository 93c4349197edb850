"""Progress of the first start after an installation, in which numba compiles."""

from __future__ import annotations

import time
from collections.abc import Callable

TELL_EVERY_S = 5.0


class CompileProgress:
    """Counts functions whose compilation begins; says so every few seconds.

    Parameters
    ----------
    tell
        Takes a line of progress.
    """

    def __init__(self, tell: Callable[[str], None]) -> None:
        self._tell = tell
        self._functions = 0
        self._begin_s = self._told_s = time.monotonic()

    def __call__(self, name: str) -> None:
        """Note that ``name`` is being compiled."""
        self._functions += 1
        now_s = time.monotonic()
        if now_s - self._told_s >= TELL_EVERY_S:
            self._told_s = now_s
            self._tell(
                f"compiling {name}, {self._functions} functions in "
                f"{now_s - self._begin_s:.0f} s; later starts take them from disk"
            )
