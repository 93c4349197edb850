"""A user interface that needs the main thread of its process."""

from __future__ import annotations

from typing import Protocol, runtime_checkable


@runtime_checkable
class Foreground(Protocol):
    """A user interface that needs the main thread while the node runs in another."""

    def run(self) -> None:
        """Run in the main thread until the operator quits or ``leave`` is called."""
        ...

    def leave(self) -> None:
        """Make ``run`` return because the node has ended; called from the other thread."""
        ...

    def close(self) -> None:
        """Release resources at the very end."""
        ...
