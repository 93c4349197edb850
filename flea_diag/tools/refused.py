"""What stands in place of a result where there is none."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, TypeVar

from flea_diag.errors import FleaError

Result = TypeVar("Result")
DIED = "the process died: killed, out of memory, or a crash in a library"


class Refused(NamedTuple):
    """In place of a result: why there is none."""

    words: str


def refusing(work: Callable[[], Result]) -> Result | Refused:
    """What the work returns, or the words of the error with which it refuses its input."""
    try:
        return work()
    except FleaError as error:
        return Refused(str(error))
