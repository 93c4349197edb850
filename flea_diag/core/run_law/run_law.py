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

"""The law of a healthy recording, as a calibration holds it.

In windows of 0.2 s, for all relations together,

    r = Psi (u + c) + g + e

``u`` is what the unit differs by from the design, ``c`` what this recording differs by, which moves
within a long one with a time constant, ``g`` what the relations neglect, ``e`` noise. Psi are
signals of the recording (``law_columns``).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt

from flea_diag.core.frozen import Frozen
from flea_diag.core.run_law.law_columns import NEGLECTED
from flea_diag.core.run_law.law_noise import LawNoise
from flea_diag.core.run_law.motion_noise import ANY_MOTION
from flea_diag.core.run_law.restricted_likelihood import Spread
from flea_diag.fields.values import Count, NotNegative, Positive, within

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class LawTerm(Frozen):
    """One column: what it is on average, and by how much units and recordings differ in it.

    One standard deviation each, in SI units; ``unit_sigma`` is 0 of what no unit has.
    ``relation`` is that of a neglected term. ``claim_sigma`` is that of the normal distribution
    that a claim of a recording is held against, wider the fewer recordings show the term
    (``known_variance``); 0: not known, ``run_sigma``.
    """

    name: str
    kind: str
    mean: float
    run_sigma: NotNegative
    unit_sigma: NotNegative = 0.0
    relation: str = ""
    claim_sigma: NotNegative = 0.0


@dataclass(frozen=True, slots=True)
class RelationNoise(Frozen):
    """Noise of one relation in windows, in its unit.

    ``shared`` is what it has of the relations before it, ``motion`` its variance at rest and for
    one of each of ``MOTIONS``, over that of the noise; empty: the same in every motion.
    ``by_slope`` is what it has of those before it by the slope of the sign of the current.
    """

    relation: str
    white: NotNegative
    coloured: NotNegative
    phi: Annotated[float, within(0.0, 1.0)]
    shared: tuple[float, ...] = ()
    motion: tuple[NotNegative, ...] = ()
    by_slope: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class FeignedSize(Frozen):
    """Size of a fault that healthy recordings feign, on average.

    ``sigma`` is by how much it scatters beyond what the noise of a recording explains,
    ``claim_sigma`` what a fault from before the recording is held against; 0: ``sigma``.
    ``onset_sigma`` is the scatter of what begins within a healthy recording; 0: not known.
    """

    fault: str
    size: str
    mean: float
    sigma: NotNegative
    claim_sigma: NotNegative = 0.0
    onset_sigma: NotNegative = 0.0

    @property
    def begun_sigma(self) -> float:
        """What a fault that begins within a recording is held against."""
        return max(self.sigma, self.onset_sigma)


@dataclass(frozen=True, slots=True)
class VisibleSize(Frozen):
    """The size from which on half of the recordings show a fault; infinite: at no size.

    Attributes
    ----------
    onset, before
        Detected by the law: a fault that begins in a recording, and one from before it.
    named
        From its onset told from all other faults, but for ``alike``.
    limits
        Detected by the limits of the tests that decide, from its onset.
    largest
        In the catalogue.
    """

    fault: str
    size: str
    unit: str
    onset: NotNegative = math.inf
    before: NotNegative = math.inf
    named: NotNegative = math.inf
    limits: NotNegative = math.inf
    largest: NotNegative = math.inf
    alike: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class LawScore(Frozen):
    """How well the law foretells recordings that it was learned without.

    Attributes
    ----------
    log_score
        Log density of one value, nats, mean over left-out recordings; ``separate`` is the same of
        noise that holds what recordings differ by, one variance a relation.
    spread
        Root mean square of their standardised means, 1 where the law is right.
    beyond_two
        Share of them beyond two standard deviations, 0.05 where the law is right.
    means
        Number of these means.
    """

    log_score: float
    separate: float
    spread: NotNegative
    beyond_two: Annotated[float, within(0.0, 1.0)]
    means: Count


@dataclass(frozen=True)
class RunLaw(Frozen):
    """See the module's first lines.

    Attributes
    ----------
    mean_covariance
        Of the means of the terms, lower triangle by rows, in SI units.
    units
        Of the recordings. With fewer than ``LEAST_UNITS`` the ``unit_sigma`` of a term is the
        description's tolerance.
    time_constant_s
        Of what moves within a recording; the longest that is told from a constant.
    usual_speed
        Median speed in motion, in the unit of the signal that is the speed; 0: not known.
    travel
        Lowest and highest place along the stroke; empty: not known.
    """

    terms: tuple[LawTerm, ...]
    noise: tuple[RelationNoise, ...]
    mean_covariance: tuple[tuple[float, ...], ...]
    recordings: Count
    units: Count
    time_constant_s: Positive
    score: LawScore | None = None
    feigned: tuple[FeignedSize, ...] = ()
    unlike: tuple[tuple[str, str], ...] = ()
    """Recordings that it was learned without, and why."""
    visible: tuple[VisibleSize, ...] = ()
    usual_speed: NotNegative = 0.0
    travel: tuple[float, ...] = ()

    @property
    def relations(self) -> tuple[str, ...]:
        """Names of the relations, in their order."""
        return tuple(row.relation for row in self.noise)

    @cached_property
    def law_noise(self) -> LawNoise:
        """Noise as arrays."""
        count = len(self.noise)
        shared, by_slope = np.zeros((2, count, count))
        for place, row in enumerate(self.noise):
            shared[place, : len(row.shared)] = row.shared
            by_slope[place, : len(row.by_slope)] = row.by_slope
        rows = np.array([(r.white, r.coloured, r.phi) for r in self.noise]).T
        motion = np.array([r.motion or ANY_MOTION for r in self.noise])
        square = np.square(rows[:2])
        return LawNoise(square[0], square[1], rows[2], shared, by_slope, motion)

    @cached_property
    def mean(self) -> Array:
        """Means of the terms, shape (terms,)."""
        return np.array([term.mean for term in self.terms])

    @cached_property
    def run_variance(self) -> Array:
        """Variances between recordings that a claim is held against, shape (terms,).

        What the relations neglect is no claim: its variance is small, and stays as it was found.
        """
        return np.square([
            term.run_sigma if term.kind == NEGLECTED else term.claim_sigma or term.run_sigma
            for term in self.terms
        ])  # fmt: skip

    @cached_property
    def unit_variance(self) -> Array:
        """Variances between units, shape (terms,)."""
        return np.square([term.unit_sigma for term in self.terms])

    @cached_property
    def covariance(self) -> Array:
        """Covariance of the means, shape (terms, terms)."""
        count = len(self.terms)
        lower = np.zeros((count, count))
        for place, row in enumerate(self.mean_covariance):
            lower[place, : len(row)] = row
        return np.asarray(lower + np.tril(lower, -1).T)

    def spread(self, another_unit: bool = False) -> Spread:
        """What a recording differs by, of the one unit that was recorded or of another one."""
        other = another_unit or self.units > 1
        variance = self.run_variance + (self.unit_variance if other else 0.0)
        return Spread(self.mean, variance, self.covariance)

    def drift_per_minute(self, term: LawTerm) -> float:
        """Standard deviation of what a term changes by within a minute."""
        share = -math.expm1(-60.0 / self.time_constant_s)
        return term.run_sigma * math.sqrt(2.0 * share)

    def to_mapping(self) -> dict[str, Any]:
        """Plain mapping, without sizes that no recording shows and digits that say nothing."""
        return {entry.name: _plain(getattr(self, entry.name)) for entry in fields(self)}

    def contradictions(self) -> list[str]:
        """What is wrong between its entries, in words."""
        wrong = []
        count = len(self.terms)
        if [len(row) for row in self.mean_covariance] != list(range(1, count + 1)):
            wrong.append(f"mean_covariance is no lower triangle of {count} rows")
        if self.travel and (len(self.travel) != 2 or not self.travel[0] <= self.travel[1]):
            wrong.append("travel is not the lowest and the highest place")
        for place, row in enumerate(self.noise):
            for name in ("shared", "by_slope"):
                if len(getattr(row, name)) > place:
                    wrong.append(f"noise of {row.relation}: {name} has more than {place} numbers")
            if row.motion and (len(row.motion) != len(ANY_MOTION) or not row.motion[0]):
                wrong.append(
                    f"noise of {row.relation}: motion is not {len(ANY_MOTION)} numbers "
                    "of which the first is positive"
                )
            if not row.white + row.coloured > 0.0:
                wrong.append(f"noise of {row.relation} is 0")
        return wrong


DIGITS = 6
"""Significant digits of a file: no recording tells a seventh."""


def _plain(value: Any) -> Any:
    if hasattr(value, "__dataclass_fields__"):
        entries = {key.name: _plain(getattr(value, key.name)) for key in fields(value)}
        return {key: entry for key, entry in entries.items() if entry is not None}
    if isinstance(value, tuple):
        return [_plain(entry) for entry in value]
    if isinstance(value, float):
        return float(f"{value:.{DIGITS}g}") if math.isfinite(value) else None
    return value
