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

"""Report of ``flea calibrate``: parameters with errors, parameters not identified, limits."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from flea_diag.core.calibration.calibration import Calibration
    from flea_diag.core.calibration.out_of_sample import OutOfSample
    from flea_diag.core.residuals.leverage import CalibrationEnvelope
    from flea_diag.core.residuals.relation_set import RelationSet
    from flea_diag.tools.calibrate.operating_points import OperatingPoints

STRONG = 0.7
"""Correlation above which two parameters are reported as hard to separate."""


def words(calibration: Calibration, relations: RelationSet) -> str:
    """The whole report."""
    c = calibration
    lines = [f"{len(c.sources)} nominal recordings, {c.nominal_s:.0f} s", ""]
    lines += _parameters(c, relations)
    lines += _correlations(c)
    lines += ["", f"limits for {c.false_alarms_per_hour} false alarms per hour, all tests together"]
    lines += _promise(c)
    lines += _limits(c)
    if c.out_of_sample:
        lines += ["", *_judged(c.out_of_sample)]
    for row in c.left_out:
        lines.append(f"left out: {row.recording}: {row.reason}")
    if c.envelope:
        from flea_diag.tools.calibrate.operating_points import OperatingPoints

        lines += ["", *_envelope(c.envelope, OperatingPoints(c, relations))]
        lines += _heat(c.envelope, relations)
    if c.law is not None:
        from flea_diag.tools.calibrate.law_words import words as law_words

        lines += ["", *law_words(c.law, relations)]
    if c.bad_stretches:
        lines += ["", "stretches excluded as implausible"]
    for bad in c.bad_stretches:
        lines.append(f"{bad.run}: {bad.channel} from {bad.start_s:.2f} to {bad.end_s:.2f} s")
    return "\n".join(lines)


def _judged(shown: OutOfSample) -> Iterator[str]:
    """How near recordings came to a false alarm by limits that they had no part in."""
    yield (
        f"judged without themselves, {shown.recordings} recordings reach at most "
        f"{shown.largest:.2f} of a limit, {shown.alarms or 'none'} of them beyond it"
    )
    if shown.widening > 1.0:
        yield f"limits widened by up to {shown.widening:.2f}, as the tails of these figures ask for"


def _envelope(seen: CalibrationEnvelope, points: OperatingPoints) -> Iterator[str]:
    """Where the recordings lie, and what would widen that."""
    from flea_diag.core.calibration.limits.window_fit import LEAST_IN_REGION
    from flea_diag.core.residuals.leverage import ABSTAIN, PLACE

    yield "envelope: signal                 smallest    largest"
    for name, (low, high) in seen.ranges.items():
        yield f"{name:31s}  {low:9.4g}  {high:9.4g}"
    for row in seen.relations:
        far = "" if row.relation == PLACE else f", no test beyond {ABSTAIN * row.most:.0f}"
        yield f"{row.relation}: leverage up to {row.reach:.1f} (99 % of the scans; mean 1){far}"
    if seen.travel is not None:
        low, high = seen.travel.edges
        yield f"fewer than {LEAST_IN_REGION} recordings came below {low:.4g} or above {high:.4g}:"
        for name, (below, _, above) in seen.travel.factors.items():
            yield f"{name}: limits {below:.2g} times as wide below, {above:.2g} above"
    yield "recordings beyond these values widen it, and those that bring them together:"
    yield from points.not_covered()


def _heat(seen: CalibrationEnvelope, relations: RelationSet) -> Iterator[str]:
    """What has supplied each predicted temperature, and from where on that is too much."""
    from flea_diag.core.residuals.leverage import ABSTAIN
    from flea_diag.core.residuals.thermal import CORRECTION_S

    for store in relations.predictions:
        most = seen.supplies.get(store.name)
        if most is not None:
            yield (
                f"{store.name}: supplied with up to {most:.3g} {store.unit}/s, mean of "
                f"{CORRECTION_S:.0f} s; no test beyond {ABSTAIN**0.5 * most:.3g} {store.unit}/s"
            )


def _promise(c: Calibration) -> Iterator[str]:
    """The rate that the recordings support, and what would support the stated one."""
    yield c.promise.words()
    needed = c.promise.needed_hours
    if c.promise.supported_per_hour > c.promise.stated_per_hour:
        yield f"{needed:.3g} h without a false alarm would support the stated rate"


def _parameters(c: Calibration, relations: RelationSet) -> Iterator[str]:
    """Those of the description; in its units, whatever unit a name ends in."""
    yield "parameter                       value        unit       standard error"
    for name in (entry.name for entry in fields(c.parameters) if entry.name in relations.base):
        value, unit = getattr(c.parameters, name), relations.base_units[name]
        error = c.sigmas.get(name)
        said = c.not_identified.get(name, "" if error is None else f"{error:.2g}")
        yield f"{name:30s}  {value:<11.5g}  {unit:9s}  {said}"


def _correlations(c: Calibration) -> list[str]:
    """Pairs of parameters whose errors compensate each other."""
    pairs = []
    for block in c.covariance:
        for i, one in enumerate(block.parameters):
            for j, other in enumerate(block.parameters[:i]):
                scale = (block.matrix[i][i] * block.matrix[j][j]) ** 0.5
                share = block.matrix[i][j] / scale if scale > 0.0 else 0.0
                if abs(share) >= STRONG:
                    pairs.append(f"{other} and {one}: {share:+.2f}")
    return ["", "strongly correlated errors", *pairs] if pairs else []


def _limits(c: Calibration) -> Iterator[str]:
    yield "residual                         window     sigma     limit of |z|"
    for limit in c.limits:
        for window in limit.windows:
            yield f"{limit.name:31s}  {window.window:6d}  {window.sigma[0]:9.3g}  {window.k:6.1f}"
