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

"""A message quotes any value in one short line, whatever somebody else has made of it."""

from __future__ import annotations

import resource
import time
from typing import Any

import pytest

from flea_diag.errors import LONGEST_MESSAGE, LONGEST_SHOWN, ConfigurationError, shown


def nested(width: int, levels: int) -> list[Any]:
    """Lists of lists that hold one another: width ** levels entries when they are written out."""
    value: list[Any] = ["x"]
    for _ in range(levels):
        value = [value] * width
    return value


def circle() -> list[Any]:
    value: list[Any] = []
    value.append(value)
    return value


QUOTED = {
    "text": ("jam", "'jam'"),
    "letters of other scripts": ("µ °C", "'µ °C'"),
    "escape": ("\x1b[31m", r"'\x1b[31m'"),
    "bell and line": ("\a\n", r"'\x07\n'"),
    "C1 control": ("\x9b2J", r"'\x9b2J'"),
    "direction": ("a\u202eb", r"'a\u202eb'"),
    "lone surrogate": ("\ud800", r"'\ud800'"),
    "key with an escape": ({"\x1b": 1}, r"{'\x1b': 1}"),
    "number": (-1.5, "-1.5"),
    "nothing": (None, "None"),
    "truth value": (True, "True"),
    "list": ([1, "a"], "[1, 'a']"),
    "tuple": ((1, 2), "(1, 2)"),
    "mapping": ({"a": [1]}, "{'a': [1]}"),
    "bytes": (b"\xff", r"b'\xff'"),
    "as long as it may be": ("x" * (LONGEST_SHOWN - 2), repr("x" * (LONGEST_SHOWN - 2))),
}
CUT = {
    "long text": "x" * 10**7,
    "text of controls": "\x1b" * 1000,
    "aliases": nested(9, 60),
    "aliases of mappings": {"a": nested(9, 60)},
    "aliases as keys": {("k",) * 100: 1},
    "itself": circle(),
    "many": list(range(10**6)),
    "long bytes": b"\x00" * 10**7,
}


@pytest.mark.parametrize("name", QUOTED)
def test_a_value_is_quoted_as_its_literal(name: str) -> None:
    value, literal = QUOTED[name]
    assert shown(value) == literal


@pytest.mark.parametrize("name", CUT)
def test_a_long_value_is_cut(name: str) -> None:
    before_s, before_kb = time.process_time(), peak_kb()
    text = shown(CUT[name])
    assert len(text) == LONGEST_SHOWN
    assert text.endswith("...")
    assert text.isprintable()
    assert time.process_time() - before_s < 10.0
    assert peak_kb() - before_kb < 50_000


def test_digits_are_counted_where_writing_them_would_take_long() -> None:
    assert shown(10**500_000 - 1) == "a whole number of some 500000 digits"
    assert shown(-(10**6000)) == "a whole number of some 6000 digits"
    assert shown(10**18) == "1000000000000000000"


def peak_kb() -> int:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


NEAR = {
    "quoted, with what to do": (
        "stand 'jiont' is not shipped, known are ema, flea, joint; a folder of your own is ./jiont",
        "; did you mean joint?",
    ),
    "an option": (
        "--fault winding_shot is unknown: choose of jam, winding_short",
        "winding_short?",
    ),
    "neither nor": ("machine 'emma' is neither a YAML file nor one of ema, wing", "mean ema?"),
    "a key": ("x.yaml: unknown key 'rate_hzz', known are rate_hz, unit", "mean rate_hz?"),
}
FAR = (
    "stand 'none' is not shipped, known are ema, flea, joint",
    "bags/x: damaged; known are the first 3 scans",
    "'jam' is unknown, did you mean ham?; choose one of ham, jams",
)


@pytest.mark.parametrize("name", NEAR)
def test_a_mistyped_word_comes_with_the_one_that_is_known(name: str) -> None:
    text, end = NEAR[name]
    said = str(ConfigurationError(text))
    assert said.startswith(text)
    assert said.endswith(end)


@pytest.mark.parametrize("text", FAR)
def test_nothing_is_guessed_where_no_word_is_like_it_or_it_was_said_before(text: str) -> None:
    assert str(ConfigurationError(text)) == text


def test_a_long_list_is_cut_and_the_word_is_not() -> None:
    names = ", ".join(f"channel_{number}_bias" for number in range(200))
    said = str(ConfigurationError(f"'channel_77_bais' is unknown, choose one of {names}"))
    assert len(said) <= LONGEST_MESSAGE
    assert said.endswith("; did you mean channel_77_bias?")
