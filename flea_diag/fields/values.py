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

"""Single values: text, truth, whole numbers, numbers; each with its limits."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any

from flea_diag.errors import shown

Reader = Callable[[Any], Any]

LONGEST_TEXT = 10_000
LARGEST_INTEGER = 2**63

IN_SI = (1e-15, 1e15)
"""Magnitudes that a quantity in SI units may have; values outside are taken for a unit error."""
LIMITED = (1e-60, 1e15)
"""The same for variances and coefficients; below, squares and quotients are no numbers."""
FINITE = (0.0, sys.float_info.max)
ANY = None
"""Infinities and NaN too."""


@dataclass(frozen=True)
class FieldLimits:
    """What narrows the numbers or the text of a field; ``above`` is an end that is excluded.

    It stands in the type, ``Annotated[float, within(0.0, 1.0)]``, or is that of a parameter.
    ``open``: what leaves the field open, NaN or infinity.
    """

    minimum: float | None = None
    maximum: float | None = None
    above: float | None = None
    choices: tuple[Any, ...] = ()
    unit: str = ""
    open: float | None = None


def within(
    minimum: float | None = None, maximum: float | None = None, *, above: float | None = None
) -> FieldLimits:
    """Range of a number, or of each number in the field."""
    return FieldLimits(minimum, maximum, above)


def one_of(*choices: str | int) -> FieldLimits:
    """Words that a text may be, or values of a whole number."""
    return FieldLimits(choices=choices)


@dataclass(frozen=True)
class WrittenAs:
    """Key of the field in a file, where its own is a word of Python."""

    key: str


AboveZero = Annotated[float, within(above=0.0)]
Positive = Annotated[float, within(1e-12, above=0.0)]
"""What the arithmetic divides by."""
NotNegative = Annotated[float, within(0.0)]
Share = Annotated[float, within(0.0, 1.0)]
Count = Annotated[int, within(0)]
AtLeastOne = Annotated[int, within(1)]


class Refusal(Exception):  # noqa: N818
    """Words that follow the name of the place: `` = 5 must be text`` or ``: x is missing``."""


@dataclass(frozen=True)
class FieldRules:
    """How all values of a document are read, see ``read_as``."""

    magnitudes: tuple[float, float] | None
    strict: bool


def refused(value: Any, words: str) -> Refusal:
    """The refusal of a value, which it quotes."""
    return Refusal(f" = {shown(value)} {words}")


def anything(value: Any) -> Any:
    """A value of any kind."""
    return value


def _text(_: FieldRules, limits: FieldLimits) -> Reader:
    choices = limits.choices

    def read(value: Any) -> str:
        if not isinstance(value, str):
            raise refused(value, "must be text")
        if len(value) > LONGEST_TEXT:
            raise refused(value, f"must be text of at most {LONGEST_TEXT} characters")
        if choices:
            _check_choice(value, choices)
        return value

    return read


def _check_choice(value: Any, choices: tuple[Any, ...]) -> None:
    if value not in choices:
        raise refused(value, f"is unknown, choose one of {', '.join(map(str, choices))}")


def _truth(_: FieldRules, limits: FieldLimits) -> Reader:
    def read(value: Any) -> bool:
        if not isinstance(value, bool):
            raise refused(value, "must be true or false")
        return value

    return read


def _whole(_: FieldRules, limits: FieldLimits) -> Reader:
    check = _bounds(limits)

    def read(value: Any) -> int:
        if type(value) is not int:
            raise refused(value, "must be a whole number")
        if abs(value) >= LARGEST_INTEGER:
            raise refused(value, "must be a whole number of 64 bits")
        check(value)
        if limits.choices:
            _check_choice(value, limits.choices)
        return value

    return read


def _number(rules: FieldRules, limits: FieldLimits) -> Reader:
    check, open_ = _bounds(limits), limits.open

    def read(value: Any) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise refused(value, f"must be a number{_hint(value)}")
        number = value if isinstance(value, float) else _float(value)
        if open_ is not None and (number == open_ or (number != number and open_ != open_)):
            return number
        _check_magnitude(number, value, rules.magnitudes)
        check(number)
        return number

    return read


def _float(value: int) -> float:
    """A whole number as a float; infinite where a float cannot hold it."""
    return float(value) if abs(value) < 2**1023 else math.inf if value > 0 else -math.inf


def _hint(value: Any) -> str:
    """What to write, where a text looks like a number."""
    try:
        looks = isinstance(value, str) and "e" in value.lower() and math.isfinite(float(value))
    except ValueError:
        looks = False
    return " (YAML reads 5e6 as text, write 5.0e+6)" if looks else ""


def _check_magnitude(number: float, value: Any, magnitudes: tuple[float, float] | None) -> None:
    if magnitudes is None:
        return
    low, high = magnitudes
    if not math.isfinite(number):
        raise refused(value, "must be a finite number")
    if number and not low <= abs(number) <= high:
        beyond = f"lies outside {low:g} to {high:g}" if low else f"is beyond {high:g}"
        raise refused(value, f"{beyond}; check its unit")


def _bounds(limits: FieldLimits) -> Callable[[float], None]:
    minimum, maximum, above = limits.minimum, limits.maximum, limits.above
    said = f" {limits.unit}" if limits.unit not in ("", "1") else ""

    def check(value: float) -> None:
        if above is not None and not value > above:
            raise refused(value, f"must be above {above:g}{said}")
        if minimum is not None and not value >= minimum:
            raise Refusal(f" = {shown(value)}{said} is below its limit {minimum!r}{said}")
        if maximum is not None and not value <= maximum:
            raise Refusal(f" = {shown(value)}{said} is above its limit {maximum!r}{said}")

    return check


SIMPLE: dict[Any, Callable[[FieldRules, FieldLimits], Reader]] = {
    str: _text, bool: _truth, int: _whole, float: _number,
}  # fmt: skip
