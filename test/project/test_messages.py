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

"""docs/messages.md has every field of every record, and its examples are those of the bags."""

from __future__ import annotations

import dataclasses
import re
from types import ModuleType
from typing import Any, get_type_hints

import pytest
from support.places import ROOT, script

from flea_diag.wire import records as r
from flea_diag.wire.messages.codec import decode, encode
from flea_diag.wire.topics import TOPICS, Topic

PAGE = (ROOT / "docs" / "messages.md").read_text(encoding="utf-8")
PARTS = {
    "sensors/channels": (r.ChannelInfo,),
    "data_quality": (r.ChannelQuality, r.UnitOffset, r.JudgedTest),
    "symbol": (r.Symbol,),
    "hypotheses": (r.Candidate, r.Evidence, r.NextTest),
    "ambiguity_group": (r.TwoFaults, r.Recurrence),
    "size_trend": (r.SizeAt,),
}
"""Classes that a record is made of, described in the section of its topic."""
SAID_ABOVE = {"stamp_ns"}
"""The header's stamp is described once for all."""

TYPES = {
    str: "str",
    int: "int",
    float: "float",
    bool: "bool",
    r.Outcome: "str",
    r.Quality: "str",
    r.RemarkKind: "str",
    r.Cause: "str",
    tuple[str, ...]: "list",
    tuple[tuple[str, str], ...]: "pairs of str",
    tuple[tuple[str, int], ...]: "pairs of int",
    tuple[r.Evidence, ...]: "objects",
    tuple[r.NextTest, ...]: "objects",
    tuple[r.UnitOffset, ...]: "objects",
    tuple[r.Recurrence, ...]: "objects",
    tuple[r.JudgedTest, ...]: "objects",
    tuple[r.SizeAt, ...]: "objects",
    tuple[r.TwoFaults, ...]: "objects",
    tuple[r.ChannelInfo, ...]: "one status each",
    tuple[r.ChannelQuality, ...]: "one status each",
    tuple[r.Symbol, ...]: "one status each",
    tuple[r.Candidate, ...]: "one status each",
}
"""How the page names the type of a field of a judgement."""


def section(topic: str) -> str:
    """What the page says of a topic."""
    found = re.search(rf"^## {re.escape(topic)}\n(.*?)(?=^## |\Z)", PAGE, re.MULTILINE | re.DOTALL)
    assert found, f"docs/messages.md has no section {topic}"
    return found[1]


def tables(text: str) -> dict[str, dict[str, str]]:
    """Title of the first column -> first word of each row -> second cell."""
    found: dict[str, dict[str, str]] = {}
    title = ""
    for line in text.splitlines():
        cells = [cell.strip() for cell in line.replace("\\|", "").strip("|").split("|")]
        if not line.startswith("|"):
            title = ""
        elif not title:
            title = cells[0]
            found[title] = {}
        elif not line.startswith("|--"):
            for name in re.findall(r"`([^`]+)`", cells[0])[:1]:
                found[title][name] = cells[1]
    return found


def undocumented(kind: type, rows: dict[str, str], types: bool) -> list[str]:
    """Fields that have no row, rows of no field, and rows with another type."""
    hints = get_type_hints(kind)
    fields = {field.name: field for field in dataclasses.fields(kind)}
    if kind is not r.Evidence:
        fields = {name: field for name, field in fields.items() if name not in SAID_ABOVE}
    wrong = [f"{kind.__name__}.{name}: no row" for name in fields if name not in rows]
    wrong += [f"{kind.__name__}: row {name} is no field" for name in rows if name not in fields]
    for name, field in fields.items() if types else ():
        said = TYPES[hints[name]]
        if said in ("str", "int", "float", "bool") and field.default is dataclasses.MISSING:
            said += ", required"
        if rows.get(name, said) != said:
            wrong.append(f"{kind.__name__}.{name}: {rows[name]!r}, it is {said!r}")
    return wrong


@pytest.mark.parametrize("topic", TOPICS, ids=lambda topic: topic.name)
def test_every_field_is_described(topic: Topic) -> None:
    judgement = topic.message.endswith("DiagnosticArray") and topic.record is not r.Health
    found = tables(section(topic.name))
    own = next(rows for title, rows in found.items() if not title.startswith("key of"))
    assert undocumented(topic.record, own, judgement) == []
    for part in PARTS.get(topic.name, ()):
        assert undocumented(part, found[f"key of {part.__name__}"], True) == []


def test_a_field_without_a_row_is_found() -> None:
    @dataclasses.dataclass
    class Grown:
        stamp_ns: int
        fault: str
        more: float = 0.0

    assert undocumented(Grown, {"fault": "str"}, False) == ["Grown.more: no row"]
    assert undocumented(r.Truth, {"fault": "int", "gone": "str"}, True) == [
        "Truth.onset_ns: no row",
        "Truth.details: no row",
        "Truth: row gone is no field",
        "Truth.fault: 'int', it is 'str, required'",
    ]


def test_the_parts_are_those_of_the_records() -> None:
    """No class that a record holds is left out of ``PARTS``."""
    known = {part for parts in PARTS.values() for part in parts}
    held = {
        inner
        for topic in TOPICS
        for holder in (topic.record, *known)
        for hint in get_type_hints(holder).values()
        for inner in getattr(hint, "__args__", ())
        if dataclasses.is_dataclass(inner)
    }
    assert held == known


def hook() -> ModuleType:
    return script("docs/hooks/messages.py")


def test_every_topic_has_an_example() -> None:
    assert re.findall(r"<!-- echo (\S+) -->", PAGE) == [
        re.findall(r"^## (\S+)$", PAGE, re.MULTILINE)[place]
        for place in range(len(TOPICS))
    ]  # fmt: skip
    assert {topic.name for topic in TOPICS} == set(re.findall(r"<!-- echo (\S+) -->", PAGE))


def test_the_examples_are_those_of_the_bags() -> None:
    """Else renew them: .venv/bin/python docs/hooks/messages.py."""
    assert hook().examples(PAGE) == PAGE


@pytest.mark.parametrize("record", hook().MADE, ids=lambda record: type(record).__name__)
def test_what_no_bag_holds_is_a_message_nonetheless(record: Any) -> None:
    assert decode(type(record), encode(record)) == record
