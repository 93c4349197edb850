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

"""Each field is held against its type and range; the message names it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

import pytest

from flea_diag.errors import ConfigurationError
from flea_diag.fields.reader import read_as
from flea_diag.fields.values import ANY, FINITE, AboveZero, Share, WrittenAs, one_of, within
from flea_diag.wire.records import Outcome


@dataclass(frozen=True)
class Inner:
    name: str
    pair: tuple[str, float | None] = ("", None)


@dataclass(frozen=True)
class Outer:
    name: str
    count: int = 0
    size: float = 0.0
    sure: bool = False
    none: float | None = None
    names: tuple[str, ...] = ()
    table: Mapping[str, Annotated[float, within(0.0, 1e9)]] | None = None
    inner: tuple[Inner, ...] = ()
    outcome: Outcome = Outcome.NOMINAL
    share: Share = 0.5
    shares: tuple[Share, ...] = ()


WHOLE: dict[str, Any] = {
    "name": "a", "count": 3, "size": 2, "sure": True, "none": None, "names": ["x", "y"],
    "inner": [{"name": "b", "pair": ["c", 1.5]}], "outcome": "ISOLATED", "share": 1.0,
    "shares": [0, 1],
}  # fmt: skip


def test_a_whole_mapping_becomes_the_record() -> None:
    found = read_as(Outer, WHOLE)
    assert found.names == ("x", "y")
    assert found.inner == (Inner("b", ("c", 1.5)),)
    assert found.outcome is Outcome.ISOLATED
    assert (found.size, type(found.size)) == (2.0, float)
    assert found.table is None, "the default, which nobody gave"


WRONG = {
    "name": (5, "name = 5 must be text"),
    "count": (1.5, "count = 1.5 must be a whole number"),
    "count as a truth value": (True, "count = True must be a whole number"),
    "count of many digits": (10**5000, "count = a whole number of some 5000 digits must be"),
    "size": ("2e6", "size = '2e6' must be a number (YAML reads 5e6 as text, write 5.0e+6)"),
    "size infinite": (math.inf, "size = inf must be a finite number"),
    "size not a number": (math.nan, "size = nan must be a finite number"),
    "size of many digits": (10**400, "size = a whole number of some 400 digits must be a finite"),
    "sure": (1, "sure = 1 must be true or false"),
    "names": ("xy", "names = 'xy' must be a list"),
    "names of numbers": ([1], "names[0] = 1 must be text"),
    "inner": ([5], "inner[0] = 5 must be a mapping of name, pair"),
    "inner without a name": ([{}], "inner[0]: name is missing"),
    "inner with a pair of three": (
        [{"name": "a", "pair": [1, 2, 3]}],
        "[0]: pair = [1, 2, 3] must have 2",
    ),
    "outcome": ("JAM", "outcome = 'JAM' is unknown, choose one of NOMINAL"),
    "share": (1.5, "share = 1.5 is above its limit 1.0"),
    "shares": ([0.5, -0.1], "shares[1] = -0.1 is below its limit 0.0"),
    "\x1b[2J": (1, r"unknown key '\x1b[2J', known are name, count"),
    "name of a megabyte": ("x" * 10**6, "... must be text of at most 10000 characters"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_field_is_named_with_its_value(case: str) -> None:
    value, words = WRONG[case]
    key = case.split(" ")[0]
    with pytest.raises(ValueError, match=r"^[^\n]+$") as caught:
        read_as(Outer, {**WHOLE, key: value}, error=ValueError, magnitudes=FINITE)
    said = str(caught.value)
    assert words in said
    assert said.isprintable()
    assert len(said) < 250


def test_a_missing_key_takes_the_default_where_there_is_one() -> None:
    assert read_as(Outer, {"name": "a"}).share == 0.5
    with pytest.raises(ValueError, match=r"^x\.yaml: name is missing; give it$"):
        read_as(Outer, {}, "x.yaml", error=ValueError)


def test_unknown_keys_are_passed_over_where_that_is_asked_for() -> None:
    assert read_as(Outer, {"name": "a", "colour": 1}, strict=False).name == "a"


def test_a_number_that_is_none_is_read_where_that_is_asked_for() -> None:
    assert math.isnan(read_as(Outer, {"name": "a", "size": math.nan}, magnitudes=ANY).size)


@dataclass(frozen=True)
class Row:
    name: str
    kind: Annotated[str, WrittenAs("type")]
    low: AboveZero = 1.0
    high: float = math.nan
    way: Annotated[str, one_of("up", "down")] = "up"

    def __post_init__(self) -> None:
        if self.high < self.low:
            raise ValueError(f"high = {self.high} is below low = {self.low}")


def row(**content: Any) -> Row:
    return read_as(Row, {"type": "R", **content}, "x.yaml: row 'a'", given={"name": "a"})


def test_what_the_caller_knows_is_given_and_a_key_may_differ_from_its_field() -> None:
    assert (row().name, row().kind) == ("a", "R")
    assert math.isnan(row(high=math.nan).high), "left open, as its default"


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ({"name": "b"}, "unknown key 'name', known are type, low, high, way"),
        ({"type": 1}, "type = 1 must be text"),
        ({"low": 0.0}, "low = 0.0 must be above 0"),
        ({"low": 1e-300}, "low = 1e-300 lies outside 1e-15 to 1e+15; check its unit"),
        ({"low": math.nan}, "low = nan must be a finite number"),
        ({"low": 2.0, "high": 1}, "high = 1.0 is below low = 2.0"),
        ({"way": "left"}, "way = 'left' is unknown, choose one of up, down"),
    ],
)
def test_limits_of_a_type_and_of_a_record_are_held(content: dict[str, Any], words: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        row(**content)
    assert f"x.yaml: row 'a': {words}" in str(caught.value)


def test_a_type_that_is_no_record_is_read_too() -> None:
    assert read_as(dict[str, float], {"a": 1}, "x") == {"a": 1.0}
    with pytest.raises(ConfigurationError, match=r"^x: a = 'b' must be a number$"):
        read_as(dict[str, float], {"a": "b"}, "x")


def test_a_key_that_is_no_plain_name_is_quoted() -> None:
    with pytest.raises(ConfigurationError, match=r"^x: '\\x1b\[2J' = 'b' must be a number$"):
        read_as(dict[str, float], {"\x1b[2J": "b"}, "x")
