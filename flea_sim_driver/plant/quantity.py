"""Fields of what a machine's file states: required, without a default, within bounds."""

from __future__ import annotations

from dataclasses import field
from typing import Any

ABOVE_ZERO = "above_zero"


def positive() -> Any:
    """A required number above 0: something is divided by it."""
    return field(metadata={ABOVE_ZERO: True})
