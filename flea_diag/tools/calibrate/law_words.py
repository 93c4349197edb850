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

"""The law of healthy recordings in words: unsound recordings, terms, and sizes that show."""

from __future__ import annotations

from collections.abc import Iterator

from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.core.run_law.run_defects import FAULT, MANY, NOISE, UnsoundRun
from flea_diag.core.run_law.run_law import RunLaw
from flea_diag.core.run_law.unit_levels import LEAST_UNITS
from flea_diag.tools.size_table import size_lines

DO = "the limits hold it, too: leave it out where that is no healthy running"


def reason_of(found: UnsoundRun, relations: RelationSet) -> str:
    """Why a recording is not as the others, with the size of the claim and what to do."""
    if found.kind == NOISE:
        return (
            f"{found.what} is {found.size:.2g} times as noisy as in the other recordings: a "
            "channel of it is bad there; the law does without it in this recording"
        )
    unit = relations.base_units.get(found.what, "")
    size = f"{found.size:+.3g} {unit}".strip()
    usual = f"{found.usual:.2g} {unit}".strip()
    where = _where(found, relations)
    if found.kind == MANY:
        what = f"several parameters are those of another unit, {found.what} most of all: {size}"
    elif found.kind == FAULT:
        what = f"it shows {found.what} from its start: {size}"
    else:
        what = f"{found.what} is off by {size}"
    return f"{what} in {where}, where the others scatter by {usual}; {DO}"


def _where(found: UnsoundRun, relations: RelationSet) -> str:
    """Relations that a claim rests on."""
    named = [row.name for row in relations.relations if found.what.startswith(row.name)]
    held = [row.name for row in relations.relations if found.what in _symbols(row.expression)]
    return ", ".join(named or held) or "all relations together"


def _symbols(expression: object) -> set[str]:
    from flea_diag.core.symbolic.expression import Expression, symbols

    assert isinstance(expression, Expression)
    return set(symbols(expression))


def words(law: RunLaw, relations: RelationSet) -> Iterator[str]:
    """The law for a report: its terms, its score, and what it and the limits can see."""
    learned = law.units >= LEAST_UNITS
    of = f"learned from {law.units} units" if learned else "by the tolerances of the description"
    yield f"law of {law.recordings} healthy recordings; what units differ by: {of}"
    yield "term                                   kind       runs differ by  units      per minute"
    for term in law.terms:
        unit = relations.base_units.get(term.name, "")
        other = f"{term.unit_sigma:.3g}" if term.unit_sigma else "-"
        drift = law.drift_per_minute(term)
        yield (
            f"{term.name:37s}  {term.kind:9s}  {term.run_sigma:<8.3g} {unit:5s}  {other:9s}  "
            f"{drift:.2g}"
        )
    if law.score is not None:
        yield (
            f"left out, recordings score {law.score.log_score:.3f} nats a value "
            f"({law.score.separate:.3f} by noise that holds what they differ by); their "
            f"standardised means scatter by {law.score.spread:.2f} (1 where the law is right), "
            f"{law.score.beyond_two:.1%} of {law.score.means} beyond 2"
        )
    for name, reason in law.unlike:
        yield f"without {name}: {reason}"
    yield ""
    yield "size that half of the recordings show"
    yield from size_lines(law.visible)
