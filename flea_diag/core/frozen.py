"""Immutable values: a deep copy of one is the value itself."""

from __future__ import annotations

from typing import TypeVar

T = TypeVar("T", bound="Frozen")


class Frozen:
    """Base of frozen dataclasses that copies of a stage's state share.

    A replay saves its state at intervals; most of the objects in it never change.
    """

    __slots__ = ()

    def __deepcopy__(self: T, memo: object) -> T:
        return self
