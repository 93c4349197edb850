"""Rows of the journal of alarms, checked field by field: another program may have written them."""

from __future__ import annotations

import json
from dataclasses import asdict, fields
from typing import TypeVar

from flea_diag.operator.alarm import Alarm, Comment, Member
from flea_diag.wire.records import Outcome, Symbol

UNREADABLE = (ValueError, TypeError, KeyError, AttributeError, RecursionError, OverflowError)
"""What a broken row raises."""
KINDS: dict[str, tuple[type, ...]] = {"int": (int,), "float": (int, float), "str": (str,)}
LARGEST_INTEGER = 2**63

T = TypeVar("T")

LEFT_OUT = ("acknowledged_ns", "acknowledged_by", "comments")
"""Fields of an alarm that are stored in columns of their own."""


def text_of(alarm: Alarm) -> str:
    """What is stored of an alarm."""
    content = asdict(alarm)
    for name in LEFT_OUT:
        del content[name]
    return json.dumps(content)


def alarm_of(
    source: object, detected_ns: object, text: str, acknowledged_ns: int, author: str
) -> Alarm:
    """Alarm of a row, without its comments; raises one of ``UNREADABLE``."""
    content = json.loads(text)
    content["outcome"] = Outcome(content["outcome"])
    content["members"] = tuple(_sound(Member(**member)) for member in content["members"])
    content["deviations"] = tuple(_sound(Symbol(**symbol)) for symbol in content["deviations"])
    content |= {"acknowledged_ns": acknowledged_ns, "acknowledged_by": author}
    known = {entry.name for entry in fields(Alarm)}
    alarm = _sound(Alarm(**{name: value for name, value in content.items() if name in known}))
    if alarm.key != (source, detected_ns):
        raise ValueError("the record is that of another alarm")
    return alarm


def comment_of(stamp_ns: int, author: str, text: str) -> Comment:
    """Comment of a row; raises one of ``UNREADABLE``."""
    return _sound(Comment(stamp_ns, author, text))


def _sound(record: T) -> T:
    """The record, if its numbers are numbers and its texts are texts.

    Raises
    ------
    TypeError
        Naming the field.
    """
    for entry in fields(record):  # type: ignore[arg-type]
        value = getattr(record, entry.name)
        kinds = KINDS.get(str(entry.type))
        if kinds and (not isinstance(value, kinds) or isinstance(value, bool)):
            raise TypeError(entry.name)
        if isinstance(value, int) and abs(value) >= LARGEST_INTEGER:
            raise ValueError(entry.name)
    return record
