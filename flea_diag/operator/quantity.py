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

"""Numbers as people read them: with their unit, and without digits that mean nothing."""

from __future__ import annotations

import math

from flea_diag.operator.words import later, tr

SIGMA = "σ"
COUNTED = (("_stuck", later("readings held")), ("_dropout", later("drop-outs")))
"""Ends of the names of residuals whose statistic is a count, and what is counted."""
OF_LIMIT = later("of its limit")
"""Unit of a statistic that is a share of its own limit."""
NEGLIGIBLE = 5e-4
"""Share of a value below which its standard error is not shown: "0.9 ± 0" claims certainty."""
DIGITS = 3


def number(
    value: float, unit: str = "", sigma: float = math.nan, unknown: str = later("unknown")
) -> str:
    """Three digits and the unit; with a standard error as many digits as that leaves certain."""
    if math.isnan(value):
        return tr(unknown)
    unit = "" if unit == "1" else unit
    if not 0.0 < sigma < math.inf or sigma < NEGLIGIBLE * abs(value):
        return f"{significant(value)} {unit}".rstrip()
    places = max(0, 1 - math.floor(math.log10(sigma)))
    if places > DIGITS + 1 or abs(value) >= 1e5:
        return f"{significant(value)} ± {significant(sigma, 2)} {unit}".rstrip()
    return f"{value:.{places}f} ± {sigma:.{places}f} {unit}".rstrip()


def significant(value: float, digits: int = DIGITS) -> str:
    """A value with so many digits, and all of those before the point up to a hundred thousand."""
    if value == 0.0 or not math.isfinite(value):
        return f"{abs(value) if value == 0.0 else value:g}"
    if digits <= math.log10(abs(value)) < 5:
        return f"{value:.0f}"
    return f"{value:.{digits}g}"


def unit_of(name: str, limit: float) -> str:
    """Unit of the test statistic of a residual: standard deviations, a count, or a share."""
    counted = next((what for end, what in COUNTED if name.endswith(end)), "")
    return counted or (OF_LIMIT if limit == 1.0 else SIGMA)


def statistic(name: str, z: float, limit: float) -> str:
    """A test statistic beside its limit; a count is a whole number and no multiple of sigma."""
    unit = unit_of(name, limit)
    if math.isfinite(z) and unit == OF_LIMIT:
        return f"{z:.0%} {tr(unit)}"
    if math.isfinite(z) and math.isfinite(limit) and unit != SIGMA:
        return f"{z:.0f} {tr(unit)}, {tr('limit')} {math.floor(limit)}"
    return f"z = {decimals(z)}, {tr('limit')} {decimals(limit)}"


def decimals(z: float) -> str:
    """A multiple of sigma to two decimals; more of them are noise."""
    return tr("unknown") if math.isnan(z) else f"{round(z, 2) + 0.0:g}"
