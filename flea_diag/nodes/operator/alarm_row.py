# Copyright 2026 flea_diag maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Rows of the journal of alarms, checked field by field: another program may have written them."""

from __future__ import annotations

import json
from dataclasses import asdict, fields

from flea_diag.errors import shown
from flea_diag.fields.reader import read_as
from flea_diag.fields.values import ANY
from flea_diag.operator.alarm import Alarm, AlarmAction, Comment
from flea_diag.wire.json_text import parse_json

LONGEST_RECORD = 1 << 20
"""Characters."""
LEFT_OUT = (
    "acknowledged_ns", "acknowledged_by", "comments", "actions", "silenced", "undoable",
)  # fmt: skip
"""Fields of an alarm that are stored in columns of their own."""
ALWAYS = ("outcome", "members", "deviations")
"""Fields that every record has; their defaults are for an alarm that has just begun."""


def text_of(alarm: Alarm) -> str:
    """What is stored of an alarm."""
    content = asdict(alarm)
    for name in LEFT_OUT:
        del content[name]
    return json.dumps(content)


def alarm_of(
    source: object, detected_ns: object, text: object, acknowledged_ns: object, author: object
) -> Alarm:
    """Alarm of a row, without its comments.

    Raises
    ------
    ValueError
        Naming what is wrong with it.
    """
    if not isinstance(text, str):
        raise ValueError(f"its record is no text of at most {LONGEST_RECORD} characters")
    # A size that is not known is NaN.
    content = parse_json(text, largest=LONGEST_RECORD, finite=False)
    if not isinstance(content, dict):
        raise ValueError(f"its record = {shown(content)} must be a mapping")
    if missing := [name for name in ALWAYS if name not in content]:
        raise ValueError(f"its record has no {missing[0]!r}")
    content |= {
        "acknowledged_ns": acknowledged_ns,
        "acknowledged_by": author,
        "comments": (),
        "actions": (),
    }
    known = {entry.name: content[entry.name] for entry in fields(Alarm) if entry.name in content}
    alarm = read_as(Alarm, known, error=ValueError, magnitudes=ANY)
    if alarm.key != (source, detected_ns):
        raise ValueError("its record is that of another alarm")
    return alarm


def action_of(
    stamp_ns: object, kind: object, author: object, text: object, until_ns: object
) -> AlarmAction:
    """Action of a row; raises ValueError."""
    content = {
        "stamp_ns": stamp_ns, "kind": kind, "author": author, "text": text, "until_ns": until_ns,
    }  # fmt: skip
    return read_as(AlarmAction, content, error=ValueError)


def comment_of(stamp_ns: object, author: object, text: object) -> Comment:
    """Comment of a row; raises ValueError."""
    content = {"stamp_ns": stamp_ns, "author": author, "text": text}
    return read_as(Comment, content, error=ValueError)
