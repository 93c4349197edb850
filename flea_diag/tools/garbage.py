"""Search for garbage (reference cycles), suited to a command that starts, works and ends."""

from __future__ import annotations

import atexit
import gc

OBJECTS = 400_000
"""Objects made before a search, 700 by default: a start makes a quarter of a million, hardly any
of them garbage, and would be searched again and again, for a quarter of its time."""


def search_less() -> None:
    """Search after many objects alone, and not what an exit drops."""
    gc.set_threshold(OBJECTS, *gc.get_threshold()[1:])
    atexit.unregister(gc.freeze)
    atexit.register(gc.freeze)
