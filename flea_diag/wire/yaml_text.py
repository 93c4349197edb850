"""YAML of others, read safely: plain values alone, and one kind of error."""

from __future__ import annotations

from typing import Any

import yaml

# Beside its own errors the parser lets through what Python makes of a date, number or tag.
_UNREADABLE = (yaml.YAMLError, ValueError, LookupError, AttributeError, RecursionError)


def parse_yaml(text: str) -> Any:
    """What a text says; bounds on its size are the caller's.

    Raises
    ------
    ValueError
        Where it is none, in one line.
    """
    try:
        return yaml.safe_load(text)
    except _UNREADABLE as error:
        raise ValueError(" ".join(str(error).split())[:300]) from error
