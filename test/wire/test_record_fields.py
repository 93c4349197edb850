"""Each field is held against its type and range; the message names it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import pytest

from flea_diag.wire.record_fields import record_of_fields, within
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
    table: Mapping[str, float] = within(0.0, 1e9, None)
    inner: tuple[Inner, ...] = ()
    outcome: Outcome = Outcome.NOMINAL
    share: float = within(0.0, 1.0, 0.5)
    shares: tuple[float, ...] = within(0.0, 1.0, ())


WHOLE: dict[str, Any] = {
    "name": "a", "count": 3, "size": 2, "sure": True, "none": None, "names": ["x", "y"],
    "inner": [{"name": "b", "pair": ["c", 1.5]}], "outcome": "ISOLATED", "share": 1.0,
    "shares": [0, 1],
}  # fmt: skip


def test_a_whole_mapping_becomes_the_record() -> None:
    found = record_of_fields(Outer, WHOLE)
    assert found.names == ("x", "y")
    assert found.inner == (Inner("b", ("c", 1.5)),)
    assert found.outcome is Outcome.ISOLATED
    assert (found.size, type(found.size)) == (2.0, float)
    assert found.table is None, "the default, which nobody gave"


WRONG = {
    "name": (5, "name: 5 must be a text"),
    "count": (1.5, "count: 1.5 must be a whole number"),
    "count as a truth value": (True, "count: True must be a whole number"),
    "count of many digits": (10**5000, "count: a whole number of some 5000 digits must be"),
    "size": ("2", "size: '2' must be a number"),
    "size infinite": (math.inf, "size: inf must be finite"),
    "size not a number": (math.nan, "size: nan must be finite"),
    "size of many digits": (10**400, "size: a whole number of some 400 digits must be a number"),
    "sure": (1, "sure: 1 must be true or false"),
    "names": ("xy", "names: 'xy' must be a list"),
    "names of numbers": ([1], "names: 1 must be a text"),
    "inner": ([5], "inner: 5 must be a mapping"),
    "inner without a name": ([{}], "inner: the key 'name' is missing"),
    "inner with a pair of three": ([{"name": "a", "pair": [1, 2, 3]}], "must have 2 entries"),
    "outcome": ("JAM", "outcome: 'JAM' must be one of"),
    "share": (1.5, "share: 1.5 lies outside 0 to 1"),
    "shares": ([0.5, -0.1], "shares: -0.1 lies outside 0 to 1"),
    "\x1b[2J": (1, r"the key '\x1b[2J' is unknown"),
    "name of a megabyte": ("x" * 10**6, "... must be a text of at most 10000 characters"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_field_is_named_with_its_value(case: str) -> None:
    value, words = WRONG[case]
    key = case.split(" ")[0]
    with pytest.raises(ValueError, match=r"^[^\n]+$") as caught:
        record_of_fields(Outer, {**WHOLE, key: value})
    said = str(caught.value)
    assert words in said
    assert said.isprintable()
    assert len(said) < 250


def test_a_missing_key_takes_the_default_where_there_is_one() -> None:
    assert record_of_fields(Outer, {"name": "a"}).share == 0.5
    with pytest.raises(ValueError, match="the key 'name' is missing"):
        record_of_fields(Outer, {})


def test_unknown_keys_are_passed_over_where_that_is_asked_for() -> None:
    assert record_of_fields(Outer, {"name": "a", "colour": 1}, strict=False).name == "a"


def test_a_number_that_is_none_is_read_where_that_is_asked_for() -> None:
    assert math.isnan(record_of_fields(Outer, {"name": "a", "size": math.nan}, finite=False).size)
