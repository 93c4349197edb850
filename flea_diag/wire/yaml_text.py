"""Safe reading of YAML: plain values only, and one type of error."""

from __future__ import annotations

from typing import Any

import yaml

# The parser also passes on Python's errors for invalid dates, numbers and tags.
_UNREADABLE = (yaml.YAMLError, ValueError, LookupError, AttributeError, RecursionError)


def parse_yaml(text: str) -> Any:
    """Content of a YAML text; the caller limits its size.

    Raises
    ------
    ValueError
        The text is not YAML; one line.
    """
    try:
        return yaml.safe_load(text)
    except _UNREADABLE as error:
        raise ValueError(" ".join(str(error).split())[:300]) from error
