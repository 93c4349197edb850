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

"""SI units as dimensions, to hold the unit somebody wrote against the one an element needs.

Only coherent SI units are known (no milli, no inch), because everything inside is SI: a
value in another unit would pass as a number and be wrong by a factor.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

from flea_diag.errors import ConfigurationError, shown

Dimension = tuple[int, int, int, int, int]
"""Exponents of kg, m, s, A, K. Angles are numbers, so rad counts as 1."""

UNITS: dict[str, Dimension] = {
    "1": (0, 0, 0, 0, 0),
    "rad": (0, 0, 0, 0, 0),
    "kg": (1, 0, 0, 0, 0),
    "m": (0, 1, 0, 0, 0),
    "s": (0, 0, 1, 0, 0),
    "A": (0, 0, 0, 1, 0),
    "K": (0, 0, 0, 0, 1),
    "degC": (0, 0, 0, 0, 1),
    "N": (1, 1, -2, 0, 0),
    "J": (1, 2, -2, 0, 0),
    "W": (1, 2, -3, 0, 0),
    "V": (1, 2, -3, -1, 0),
    "ohm": (1, 2, -3, -2, 0),
    "H": (1, 2, -2, -2, 0),
    "F": (-1, -2, 4, 2, 0),
    "Pa": (1, -1, -2, 0, 0),
}

_TOKEN = re.compile(r"([*/]?)([A-Za-z]+|1)(?:\^(-?\d+))?")


SECOND = UNITS["s"]


def dimension(unit: str) -> Dimension:
    """Dimension of a unit such as ``kg*m^2`` or ``V*s/rad`` (each ``/`` divides by one unit).

    Raises
    ------
    ConfigurationError
        When a part is not a coherent SI unit.
    """
    found = [0, 0, 0, 0, 0]
    for name, times in powers(unit):
        found = [a + times * b for a, b in zip(found, UNITS[name], strict=True)]
    return (found[0], found[1], found[2], found[3], found[4])


def powers(unit: str) -> list[tuple[str, int]]:
    """Names in a unit with their exponents, in order.

    Raises
    ------
    ConfigurationError
        When a part is not a coherent SI unit.
    """
    found, place = [], 0
    while place < len(unit):
        token = _TOKEN.match(unit, place)
        if token is None or (place > 0) != bool(token[1]) or token[2] not in UNITS:
            raise ConfigurationError(
                f"unit {shown(unit)} is not understood at {shown(unit[place:])}; write it with"
                f" {', '.join(UNITS)} and * / ^ (SI, no prefixes: 0.002 H, not 2 mH)"
            )
        found.append((token[2], int(token[3] or 1) * (-1 if token[1] == "/" else 1)))
        place = token.end()
    if not unit:
        raise ConfigurationError("unit '' is empty; a number without dimension is '1'")
    return found


def product_unit(factors: Iterable[tuple[str, int]]) -> str:
    """Unit of a product of powers, given the unit of each factor and its exponent.

    An angle that only a division brings in is a number: N*m over a screw's m/rad is N.
    """
    found, angle = dict[str, int](), 0
    for unit, exponent in factors:
        for name, own in powers(unit):
            found[name] = found.get(name, 0) + exponent * own
            angle += own if name == "rad" and exponent > 0 else 0
    found["rad"] = min(found.get("rad", 0), max(angle, 0))
    found.pop("1", None)
    above = [_power(name, times) for name, times in found.items() if times > 0]
    below = [f"/{_power(name, -times)}" for name, times in found.items() if times < 0]
    return ("*".join(above) or "1") + "".join(below)


def _power(name: str, exponent: int) -> str:
    return name if exponent == 1 else f"{name}^{exponent}"


def per(left: Dimension, right: Dimension) -> Dimension:
    """Dimension of a quotient."""
    a, b = left, right
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2], a[3] - b[3], a[4] - b[4])


def times(left: Dimension, right: Dimension) -> Dimension:
    """Dimension of a product."""
    return per(left, per(UNITS["1"], right))


def spelled(wanted: Dimension) -> str:
    """A readable unit of that dimension, for messages."""
    for name, known in UNITS.items():
        if known == wanted:
            return name
    parts = zip(("kg", "m", "s", "A", "K"), wanted, strict=True)
    return "*".join(_power(name, e) for name, e in parts if e)
