"""Values that are only ever read: a deep copy of one is the value itself."""

from __future__ import annotations

from typing import TypeVar

T = TypeVar("T", bound="Frozen")


class Frozen:
    """Base of frozen dataclasses that are shared by what is copied to go back to it later.

    A replay saves its state now and then; nearly all of what hangs on it never changes.
    """

    __slots__ = ()

    def __deepcopy__(self: T, memo: object) -> T:
        return self
