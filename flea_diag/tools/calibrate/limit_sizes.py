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

"""Sizes of faults that the limits of a calibration show: its own tests, on effects without noise.

A fault that begins in a healthy recording adds its effect to every residual. The tests of windowed
means and of shifts, which are linear in it but for their centres, say from which size on it reaches
a limit: half of all runs with that size are detected, for noise adds as often as it takes away.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.detection.detection import Detector
from flea_diag.core.detection.mean_shift import MeanShiftLimit
from flea_diag.core.residual_values import ResidualRows
from flea_diag.core.residuals.residual_rows import ResidualSet
from flea_diag.core.run_law.fault_columns import FaultColumns
from flea_diag.core.run_law.run_law import VisibleSize
from flea_diag.core.run_law.run_windows import with_neglected
from flea_diag.core.run_law.visible_sizes import BEFORE, FOLLOWED_S
from flea_diag.core.running_mean import rolling_means
from flea_diag.stages.observer.regressor_table import RegressorTable
from flea_diag.tools.calibrate.law_windows import WindowItem, WindowWork
from flea_diag.tools.calibrate.nominal_recording import NominalRecording
from flea_diag.tools.calibrate.shared_work import ALONE, Sharing

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

INSTANT = "instant_pwm"
MOST_RUNS = 12
"""Recordings whose motion is looked at, evenly over all."""


@dataclass(frozen=True)
class LimitWork:
    """Sizes in the motion of one recording, by the limits of a calibration."""

    windows: WindowWork
    calibration: Calibration
    faults: FaultColumns

    def sizes(self, item: WindowItem) -> Array:
        """The smallest size of each fault that reaches a limit, shape (faults,); infinite: none."""
        effects = self.windows.effects()
        rows, c, readings = effects.residuals, self.calibration, item.run.rows
        formed = self.windows.formed(effects, readings, frozen=False)
        table = RegressorTable(effects, c.parameters).rows(readings, formed)
        where = self.windows.along(readings, rows)
        signals = np.nan_to_num(with_neglected(table, effects, c.period_s, where))
        onset = int(BEFORE * len(readings))
        until = min(len(readings), onset + round(FOLLOWED_S / c.period_s))
        formed = _part(formed, slice(0, until))
        added = self._added(signals[:until], onset)
        quiet = self._z(formed, rows, self._values(formed, rows, np.zeros_like(added[..., 0])))
        doubted = self._doubted(rows)
        return np.array([
            np.inf if column.fault.startswith(doubted) else
            self._size(formed, rows, self._values(formed, rows, added[..., k]), quiet, onset)
            for k, column in enumerate(self.faults.columns)
        ])  # fmt: skip

    def _size(
        self, formed: ResidualRows, rows: ResidualSet, values: Array, quiet: tuple[Array, Array],
        onset: int,
    ) -> float:  # fmt: skip
        """The smallest size that reaches a limit, of residuals that hold one unit of a fault."""
        by_means = self._by_means(self._z(formed, rows, values), quiet, onset)
        return min(by_means, self._by_shifts(formed, rows, values, onset))

    def _doubted(self, rows: ResidualSet) -> tuple[str, ...]:
        """How faults of a voltage begin that nothing corroborates: it is bad data, not a fault."""
        alone = self.calibration.voltage_sampling == INSTANT and (
            not rows.command or rows.command not in self.calibration.channels
        )
        return (f"{rows.voltage}_",) if rows.voltage and alone else ()

    def _added(self, signals: Array, onset: int) -> Array:
        """What one unit of each fault adds, shape (scans, relations, faults)."""
        added = np.einsum("ns,rsf->nrf", signals, self.faults.design)
        since_s = np.maximum(np.arange(len(signals)) - onset, 0) * self.calibration.period_s
        added += since_s[:, None, None] * self.faults.design[:, self.faults.elapsed]
        added[:onset] = 0.0
        return np.asarray(added)

    def _z(self, formed: ResidualRows, rows: ResidualSet, values: Array) -> tuple[Array, Array]:
        """Statistics and limits of all residuals, shape (scans, residuals)."""
        c = self.calibration
        detector = Detector(
            rows, c.limits, c.tolerances(), c.tolerance.thermal_rate_k_per_s, counts=c.counts
        )
        found = detector.step(replace(formed, values=values))
        return found.z, found.k

    def _values(self, formed: ResidualRows, rows: ResidualSet, added: Array) -> Array:
        """Residuals that hold this effect alone, raw and normalised."""
        values = np.full_like(formed.values, np.nan)
        for place, name in enumerate(self.windows.relations):
            for row in rows.parities:
                if row.relation == name:
                    column = rows.place[row.name]
                    way = np.sign(formed.motion[:, 1]) if row.normalised else 1.0
                    values[:, column] = added[:, place] * way
            if name in rows.predictions:
                values[:, rows.place[name]] = added[:, place]
        return np.where(np.isfinite(formed.values), values, np.nan)

    def _by_means(
        self, found: tuple[Array, Array], quiet: tuple[Array, Array], onset: int
    ) -> float:
        z, k = found
        slope = (z - quiet[0])[onset:]
        room = k[onset:] - np.sign(slope) * quiet[0][onset:]
        with np.errstate(divide="ignore", invalid="ignore"):
            sizes = np.where(np.abs(slope) > 0.0, room / np.abs(slope), np.inf)
        return float(np.nanmin(sizes, initial=np.inf))

    def _by_shifts(
        self, formed: ResidualRows, rows: ResidualSet, values: Array, onset: int
    ) -> float:
        reached = [
            _largest_mean(
                values[onset:, rows.place[s.name]], _counted(formed, rows, s)[onset:], s.window
            )
            / (s.k * s.sigma)
            for s in self.calibration.mean_shifts
            if s.name in rows.place
        ]
        most = max(reached, default=0.0)
        return 1.0 / most if most > 0.0 else np.inf


def with_limits(
    seen: Sequence[VisibleSize], calibration: Calibration, work: WindowWork, faults: FaultColumns,
    recordings: Sequence[NominalRecording], sharing: Sharing = ALONE,
) -> Iterator[VisibleSize]:  # fmt: skip
    """The same rows, with the sizes that half of these recordings show by the limits."""
    chosen = recordings[:: -(-len(recordings) // MOST_RUNS)]
    items = [WindowItem(recording.run, recording.serial) for recording in chosen]
    sizes = list(sharing.over(LimitWork(work, calibration, faults).sizes, items, "visible sizes"))
    for row, size in zip(seen, np.median(sizes, axis=0), strict=True):
        yield replace(row, limits=float(size))


def _part(formed: ResidualRows, scans: slice) -> ResidualRows:
    entries = (formed.values, formed.spread, formed.signals, formed.motion, formed.moving)
    return ResidualRows(*(entry[scans] for entry in entries))


def _counted(formed: ResidualRows, rows: ResidualSet, limit: MeanShiftLimit) -> Flags:
    """Scans that count for a shift."""
    gated = rows.named[limit.name].gate == "moving"
    return formed.moving if gated else np.ones(len(formed), dtype=bool)


def _largest_mean(values: Array, counted: Flags, window: int) -> float:
    """Largest magnitude of the mean over so many scans that count."""
    taken = values[counted & np.isfinite(values)]
    if len(taken) < window:
        return 0.0
    return float(np.abs(rolling_means(taken, window)).max())
