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

"""By how much healthy units of one design differ in a parameter, as a description states it."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

from flea_diag.errors import ConfigurationError, shown
from flea_diag.fields.reader import read_as
from flea_diag.fields.values import IN_SI

LEAST = 1e-6
"""A spread of 0 would make the differences of healthy units impossible."""
_SHARE = re.compile(r"(\d+(?:\.\d+)?) ?%")


@dataclass(frozen=True)
class Tolerance:
    """One standard deviation: a share of the value, or an amount in the parameter's unit."""

    share: float = 0.0
    amount: float = 0.0

    def of(self, value: float) -> float:
        """Standard deviation of a parameter with this value."""
        return max(self.share * abs(value), self.amount, LEAST)


def tolerances(content: Any, known: Collection[str], where: str) -> dict[str, Tolerance]:
    """Name -> tolerance, as a description gives it: ``10 %`` of the value, or a number.

    Raises
    ------
    ConfigurationError
        A name is not among those known, or a tolerance is not above 0.
    """
    found = {}
    for name, value in read_as(dict[str, Any], content, where).items():
        if name not in known:
            raise ConfigurationError(
                f"{where}: {shown(name)} is no base parameter, known are {', '.join(known)}"
            )
        found[name] = _tolerance(value, f"{where}: {name}")
    return found


def free_per_run(
    content: Any, values: Mapping[str, float], where: str
) -> dict[str, tuple[float, float]]:
    """Base parameters that any recording may have its own value of, each with its range.

    ``name: [low, high]`` states a range; of a list of names each keeps its sign. ``values`` are
    those of the description.

    Raises
    ------
    ConfigurationError
        A name is not among those known, a range is none, or the description lies outside of it.
    """
    if isinstance(content, Mapping):
        ranges = read_as(dict[str, tuple[float, float]], content, where)
    else:
        names = read_as(tuple[str, ...], content, where)
        ranges = {name: _of_sign(values.get(name, 0.0)) for name in names}
    for name, (low, high) in ranges.items():
        if name not in values:
            raise ConfigurationError(
                f"{where}: {shown(name)} is no base parameter, known are {', '.join(values)}"
            )
        if not low < high:
            raise ConfigurationError(
                f"{where}: {name} = [{low:g}, {high:g}] must be a range, the lower end first"
            )
        if not low <= values[name] <= high:
            raise ConfigurationError(
                f"{where}: {name} of this description is {values[name]:g}, outside of its range "
                f"{low:g} to {high:g}; widen the range or mend the value"
            )
    return ranges


def _of_sign(value: float) -> tuple[float, float]:
    """All values of this sign."""
    return (0.0 if value > 0.0 else -math.inf, 0.0 if value < 0.0 else math.inf)


def _tolerance(value: Any, where: str) -> Tolerance:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    share = _SHARE.fullmatch(value) if isinstance(value, str) else None
    if number and 0.0 < value < IN_SI[1]:
        return Tolerance(amount=float(value))
    if share and 0.0 < float(share[1]) <= 100.0:
        return Tolerance(share=float(share[1]) / 100.0)
    raise ConfigurationError(
        f"{where} = {shown(value)} must be a share from above 0 to 100 such as '10 %', or one"
        " standard deviation above 0 in the parameter's unit"
    )
