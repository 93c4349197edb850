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

"""JSON that is enormous once it is made, or no JSON: refused in one line, in little memory."""

from __future__ import annotations

import ast

import pytest
from support.bombs.parsed import refusal
from support.places import ROOT

from flea_diag.wire.json_text import parse_json

BOMBS = {
    "deep lists": ("[" * 60_000, "nested deeper than 50 levels"),
    "deep mappings": ('{"a":' * 60_000, "nested deeper than 50 levels"),
    "deep, and closed": ("[" * 51 + "]" * 51, "nested deeper than 50 levels"),
    "many lists": (f"[{'[],' * 300_000}[]]", "more than 100000 values"),
    "many numbers": (f"[{'0,' * 500_000}0]", "more than 100000 values"),
    "many keys": ("{" + ",".join(f'"{k}":0' for k in range(101_000)) + "}", "more than 100000"),
    "many texts": (f"[{chr(34) * 900_000}]", "more than 100000 values"),
    "digits": ("9" * 500_000, "a number of more than 100 characters"),
    "digits behind the point": ("0." + "1" * 500_000, "a number of more than 100 characters"),
    "exponent": ("1e" + "9" * 500_000, "a number of more than 100 characters"),
    "long": (f'"{"x" * (1 << 20)}"', "1048578 characters, at most 1048576 are read"),
    "a key twice": ('{"a": 1, "b": 2, "a": 3}', "the key 'a' occurs twice"),
    "a long key twice": ('{"%s": 1, "%s": 2}' % (("k" * 9000,) * 2), "... occurs twice"),
    "not a number": ('{"a": NaN}', "NaN is not a number of JSON"),
    "no end": ("[-Infinity]", "-Infinity is not a number of JSON"),
    "open": ('{"a": [', "not valid JSON: Expecting value (line 1, column 8)"),
    "nothing": ("", "not valid JSON: Expecting value"),
    "two": ("1 2", "not valid JSON: Extra data"),
}


@pytest.mark.parametrize("name", BOMBS)
def test_a_bomb_is_refused_before_it_takes_memory_or_time(name: str) -> None:
    text, words = BOMBS[name]
    said = refusal("json_text", "parse_json", text)
    assert words in said
    assert said.count("\n") == 1
    assert len(said) < 200


SOUND = {
    "brackets in a text": ('{"a": "' + "[" * 500 + '"}', {"a": "[" * 500}),
    "digits in a text": ('["' + "1" * 500 + '"]', ["1" * 500]),
    "escaped quotes": (r'["\"[\\", "\\\"", "\\"]', ['"[\\', '\\"', "\\"]),
    "fifty levels": ("[" * 50 + "]" * 50, None),
    "plain": ('{"a": [1, 2.5, null, true, "x"]}', {"a": [1, 2.5, None, True, "x"]}),
}


@pytest.mark.parametrize("name", SOUND)
def test_what_stands_in_a_text_counts_for_nothing(name: str) -> None:
    text, value = SOUND[name]
    assert parse_json(text) == value if value is not None else parse_json(text)


def test_what_python_writes_for_no_number_is_read_where_it_is_asked_for() -> None:
    (value,) = parse_json("[NaN]", finite=False)
    assert value != value


def test_an_error_quotes_no_content() -> None:
    with pytest.raises(ValueError, match=r"^[^\n]+$") as caught:
        parse_json('{"secret": "root:x:0:0", oops}')
    assert "root" not in str(caught.value)


EXCEPTIONS = {
    "flea_diag/wire/json_text.py",
    "flea_diag/web/socket_gate.py",
    # Whole recordings, from the process that started it.
    "flea_diag/tools/arena/host.py",
}
"""The gate, that of the page's messages, whose length is bounded to 64 kB, and that host."""


def test_no_other_reader_of_json_is_left() -> None:
    found = {
        str(path.relative_to(ROOT))
        for package in ("flea_diag", "flea_sim_driver")
        for path in (ROOT / package).rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Attribute)
        and node.attr in ("load", "loads", "JSONDecoder")
        and getattr(node.value, "id", "") == "json"
    }
    assert found == EXCEPTIONS
