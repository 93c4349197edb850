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

"""What is learned of this unit and of this run.

The zeros of a unit's sensors are learned once, in the warm-up of a stream; what a description
leaves free per run, such as a payload, at the start and again after each rest.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.detection.window_limit import ResidualLimit
from flea_diag.core.likelihood.run_parameters import FreeTerms, RunLearning, RunValue
from flea_diag.core.likelihood.unit_start import SURE, StartLearning, UnitStart, unit_start
from flea_diag.core.residual_values import ResidualRows
from flea_diag.core.residuals.parameters import ActuatorParameters
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.core.residuals.residual_rows import ResidualSet
from flea_diag.core.running_mean import summed_in_order
from flea_diag.wire.records import FREE_PER_RUN, NEVER_NS, ChannelQuality, Quality

Array = npt.NDArray[np.float64]
Stamps = npt.NDArray[np.int64]
Offsets = Mapping[str, tuple[float, float]]
"""Unit parameter -> its change from the calibrated value, and the sigma of that."""


class WarmUp:
    """Offset learning from ``begin``, with the first scan, until the warm-up time has passed."""

    def __init__(self, known: ResidualSet, calibration: Calibration, warm_up_s: float) -> None:
        self._known = known
        self._calibration = calibration
        self._length_ns = self._ends_ns = round(warm_up_s * 1e9)
        self._learning = StartLearning(known, calibration.tolerance, calibration.variances)
        self.unit = UnitStart()
        """Which unit has started; known after the last step."""

    def begin(self, stamp_ns: int) -> None:
        """The first scan is that of this stamp."""
        self._ends_ns = stamp_ns + self._length_ns

    def leading(self, stamps_ns: Stamps) -> int:
        """How many of these scans may come in one block: the warm-up ends with a single one."""
        over = np.append(stamps_ns >= self._ends_ns, True)
        return int(over.argmax())  # the first: stamps may jump back after it

    def step(self, residuals: ResidualRows, stamp_ns: int, voltage_lost: bool) -> Offsets | None:
        """Learn from these scans; the offsets with the first scan after the warm-up.

        The zero of a voltage that is not trusted is not learned.
        """
        zeros = self._known.zeros
        if stamp_ns >= self._ends_ns:
            c, learning = self._calibration, self._learning
            self.unit = unit_start(learning.estimate(), c.parameters, c.tolerance, c.units)
            return {
                zeros[residual]: zero.offset()
                for residual, zero in learning.zeros.items()
                if not (zeros[residual] == "voltage_offset_v" and voltage_lost)
            }
        self._learning.take(residuals.values, residuals.spread, residuals.moving)
        return None


class RunWatch:
    """What this run has of its own; a block ends before the scan with which that changes."""

    def __init__(self, relations: RelationSet, terms: FreeTerms, calibration: Calibration) -> None:
        c, known = calibration, relations.residuals
        self._terms, self._calibrated = terms, c.parameters
        self._known = known
        # Least sigma of a mean, and the noise of a scan that scatters a mean so long by as much;
        # the largest limit of one, in least sigmas.
        scatter = np.array([_least(c.limit(name)) for name in terms.relations])
        self._least, variance = scatter[:, 0], np.square(scatter[:, 0]) * scatter[:, 1]
        self._learning = RunLearning(
            terms,
            {name: getattr(c.parameters, name) for name in terms.free},
            relations.free,
            {name: getattr(c.tolerance, name) for name in terms.beside},
            variance,
            self._least,
            float(np.linalg.norm(scatter[:, 2])),
            c.counts,
        )
        self.void = [*known.of_relations(terms.relations), *known.columns(known.innovations)]
        """Columns of what is not judged while another value is learned."""
        self._since_ns, self._said_last = NEVER_NS, self._words
        self.told = False
        """Whether the last scan has changed what is reported."""

    @property
    def waits(self) -> bool:
        """Whether another value has shown that is not known yet."""
        return self._learning.waits

    @property
    def restarts(self) -> bool:
        """Whether the values in use are others, not the same made more exact."""
        return self._learning.restarts

    @property
    def values(self) -> Mapping[str, float]:
        """Free parameter -> its value in use."""
        return self._learning.values

    def step(
        self, parameters: ActuatorParameters, stamps_ns: Stamps, residuals: ResidualRows,
        frozen: bool,
    ) -> int:  # fmt: skip
        """Take n scans and drop what is not judged; the first scan that changes that, or n."""
        learning, refined = self._learning, self._learning.refined
        self.told = False
        if self._since_ns == NEVER_NS:
            self._since_ns = int(stamps_ns[0])
        slopes = self._terms.of_scans(parameters, residuals.signals)
        if refined.any():
            residuals.moved = self._moved(slopes, residuals.motion[:, 1], refined)
        values = residuals.values[:, self._terms.columns]
        moving = residuals.moving.tolist()
        for scan in range(len(stamps_ns)):
            if learning.step(moving[scan], values[scan], slopes[scan], frozen):
                words = self._words
                self.told, self._said_last = words != self._said_last, words
                if self.told and scan == 0:
                    self._since_ns = int(stamps_ns[0])
                return scan
            if learning.waits:
                residuals.values[scan, self.void] = np.nan
        if learning.has_own:
            residuals.doubt = self._doubt(slopes)
        return len(stamps_ns)

    def _moved(self, slopes: Array, way: Array, refined: Array) -> Array:
        """What values that were made more exact have moved, shape (n, residuals)."""
        found = np.zeros((len(slopes), len(self._known.rows)))
        for place, name in enumerate(self._terms.relations):
            by = summed_in_order(slopes[:, place, : len(refined)] * refined)
            for column in self._known.of_relation(name):
                is_raw = column in self._terms.columns
                found[:, column] = by if is_raw else np.copysign(1.0, way) * by
        return found

    def _doubt(self, slopes: Array) -> Array:
        """Variance of each residual, shape (n, residuals), in times what was calibrated."""
        found = np.ones((len(slopes), len(self._known.rows)))
        grown = 1.0 + np.square(self._learning.errors(slopes) / self._least)
        for place, name in enumerate(self._terms.relations):
            found[:, self._known.of_relation(name)] = grown[:, place, None]
        return found

    @property
    def _words(self) -> str:
        """The values that differ from the calibration's, or that they are being learned."""
        if not self.waits:
            return ", ".join(self._said(v) for v in self._learning.found if self._differs(v))
        names, void = self._terms.free, (self._known.rows[j].name for j in self.void)
        return f"{', '.join(names)} of this run being learned: {', '.join(void)} not tested"

    def states(self) -> tuple[ChannelQuality, ...]:
        """The row of DataQuality."""
        if self._since_ns == NEVER_NS:
            return ()
        return (ChannelQuality(FREE_PER_RUN, Quality.GOOD, self._since_ns, self._words),)

    def _differs(self, found: RunValue) -> bool:
        """Whether a value is surely another one than that of the calibration."""
        change = abs(found.value - getattr(self._calibrated, found.parameter))
        return not found.within or change > SURE * found.sigma

    def _said(self, found: RunValue) -> str:
        calibrated = getattr(self._calibrated, found.parameter)
        words = f"{found.parameter} {found.value:.4g} ± {found.sigma:.2g}"
        follows = "" if found.within else ", outside its range: not taken"
        return f"{words} in this run (calibrated: {calibrated:.4g}{follows})"


def _least(limit: ResidualLimit | None) -> tuple[float, float, float]:
    """Least sigma of a mean, its scans, largest limit over it; what has no limit says nothing."""
    if limit is None:
        return np.inf, 1.0, 0.0
    sigma, scans = min((min(window.sigma), float(window.window)) for window in limit.windows)
    return sigma, scans, max(window.k * max(window.sigma) for window in limit.windows) / sigma
