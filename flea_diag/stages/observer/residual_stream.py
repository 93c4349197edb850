"""One stream of scans from its start: residuals, what is left out of them, and their tests."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.detection.detection import Detector, TestResults
from flea_diag.core.detection.mean_shift_test import ShiftTest
from flea_diag.core.likelihood.fault_models import REGRESSORS
from flea_diag.core.likelihood.regressors import regressors
from flea_diag.core.observers.observer_block import PREDICTED
from flea_diag.core.residuals.plausibility import VoltagePlausibility
from flea_diag.core.residuals.residual import SPEED, UNIT_PARAMETERS
from flea_diag.core.residuals.residual_bank import ResidualBank
from flea_diag.core.residuals.residual_rows import (
    CHANNELS,
    INDEX,
    INNOVATION_INDEX,
    RESIDUAL_INDEX,
    RESIDUALS,
    SENSOR_COLUMNS,
    SPREAD_ROWS,
    TEMPERATURES,
    ResidualRows,
)
from flea_diag.core.residuals.unit_offsets import OffsetLearning
from flea_diag.core.sensors.position_step import SPAN
from flea_diag.core.sensors.sensor_tests import SensorTests
from flea_diag.core.smoothing import KERNEL_LENGTH
from flea_diag.stages.observer.lost_scans import THERMAL_COLUMNS, LostScans
from flea_diag.stages.observer.state_estimate import StateEstimate, Told
from flea_diag.wire.records import ChannelTable, UnitOffset

Array = npt.NDArray[np.float64]
Stamps = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]

SPEED_SCANS = KERNEL_LENGTH + SPAN
"""Scans that a step of the position is seen in as a speed."""
ELECTRICAL = RESIDUAL_INDEX["parity_electrical"]
POSITION = RESIDUAL_INDEX["actuator_position"]
VOLTAGE_COLUMNS = [j for j, row in enumerate(RESIDUALS) if "motor_voltage" in row.needs]
SPEED_COLUMNS = [j for j, row in enumerate(RESIDUALS) if SPEED in row.needs]
LEARNED = {
    "parity_mechanical": "current_offset_a",
    "parity_electrical": "voltage_offset_v",
}
"""Which relation fixes which offset of this unit in the warm-up."""
_READ = np.array([INDEX[name] for name in TEMPERATURES])
_APART = np.array([RESIDUAL_INDEX[name] for name in TEMPERATURES])
_IS_PREDICTED = np.array([name in PREDICTED for name in CHANNELS])
REGRESSOR_NAMES = (*REGRESSORS, "moving")


@dataclass(slots=True)
class Tested:
    """What n scans gave.

    ``trusted`` is whether the voltage was, before each scan, shape (n,). ``turned`` is the
    first scan with which the voltage lost that trust, or n: the windows forget it from there
    on, so later rows of the same block do not count.
    """

    residuals: ResidualRows
    results: TestResults
    regressors: Array
    trusted: Flags
    turned: int
    told: Told


class ResidualStream:
    """Bank, cross-checks, this unit's offsets and tests; takes scans singly or in blocks."""

    def __init__(
        self,
        calibration: Calibration,
        estimate: StateEstimate,
        warm_up_s: float,
        start_ns: int,
        backend: str,
    ) -> None:
        c = self._calibration = calibration
        self._p = c.parameters
        self._bank = ResidualBank(
            c.parameters, period_s=c.period_s, kernel_length=KERNEL_LENGTH, backend=backend
        )
        # What nobody estimates has no innovation to wait for.
        limits = [
            limit for limit in c.limits if estimate.runs or limit.name not in INNOVATION_INDEX
        ]
        thermal = c.tolerance.thermal_rate_k_per_s
        self._detector = Detector(limits, c.tolerances(), thermal, backend)
        self._estimate = estimate
        self._plausible = VoltagePlausibility(c.voltage_limit_v)
        self._learning = {
            residual: OffsetLearning(name, c.tolerance) for residual, name in LEARNED.items()
        }
        self._learn_until_ns = start_ns + round(warm_up_s * 1e9)
        self._withheld: list[int] = []
        self.offsets: tuple[UnitOffset, ...] = ()
        """What was learned of this unit, once it was."""
        self._speed_wait = 0
        self._lost = LostScans()
        self._sensors = SensorTests(c.sensors, CHANNELS, backend)
        self._shifts = ShiftTest(c.shifts, c.tolerances(), backend)
        self._period_ns = round(c.period_s * 1e9)
        self._last_ns = start_ns

    def take_ranges(self, table: ChannelTable) -> None:
        """A reading that stands at the end of its range is clipped, not held."""
        for row in table.channels:
            self._sensors.bound(row.name, row.minimum, row.maximum)

    def alike(self, stamps_ns: Stamps) -> int:
        """How many of these scans may come in one block: the warm-up ends with a single one."""
        if not self._learning:
            return len(stamps_ns)
        over = np.append(stamps_ns >= self._learn_until_ns, True)
        return int(over.argmax())  # the first: stamps may jump back after it

    def interrupt(self) -> None:
        """There is a gap before the next scan."""
        self._lost.interrupt()
        self._bank.interrupt()
        self._sensors.interrupt()
        self._estimate.interrupt()

    def recall(self, offsets: tuple[UnitOffset, ...], within: bool) -> None:
        """Take over in mid-run what was learned of this unit, and learn it no more.

        Within an episode nothing is learned anew, and temperatures are left out: their nodes
        have begun at the readings, wrong or not.
        """
        if offsets:
            self._adopt({o.parameter: (o.value - getattr(self._p, o.parameter), o.sigma)
                         for o in offsets})  # fmt: skip
            self.offsets = offsets
        if within:
            self._learning, self._withheld = {}, THERMAL_COLUMNS

    @property
    def stuck(self) -> Mapping[str, int]:
        """Readings of each channel that were held."""
        return self._sensors.stuck

    @property
    def learns(self) -> bool:
        """Whether this is the warm-up."""
        return bool(self._learning)

    def turn(self, opened: bool) -> None:
        """An episode has opened: frozen innovations say nothing. Or closed: arm anew."""
        if not opened:
            self._withheld = []
        self._detector.forget(list(INNOVATION_INDEX.values()) if opened else range(len(RESIDUALS)))
        self._shifts.turn(opened)

    def step(self, stamps_ns: Stamps, rows: Array, frozen: bool) -> Tested:
        """Take n scans, rows of usable values; ``frozen`` stops thermal corrections."""
        before_ns = self._last_ns
        rows, sensors = self._test_sensors(stamps_ns, rows)
        lost = round((int(stamps_ns[0]) - before_ns) / self._period_ns) - 1
        if lost > 0:
            self._fill(before_ns, lost, rows[0], frozen)
        self._lost.remember(rows)
        return self._follow(stamps_ns, rows, sensors, frozen)

    def _fill(self, before_ns: int, count: int, row: Array, frozen: bool) -> None:
        """Follow rows in place of so many lost ones, or begin anew where there are none."""
        filled = self._lost.filled(count, row)
        if filled is None:
            self.interrupt()
            return
        nothing = np.full((count, len(self._sensors.k)), np.nan)
        stamps_ns = before_ns + np.arange(1, count + 1) * self._period_ns
        self._follow(stamps_ns, filled, nothing, frozen, read=False)

    def _follow(
        self, stamps_ns: Stamps, rows: Array, sensors: Array, frozen: bool, read: bool = True
    ) -> Tested:
        residuals = self._bank.step(rows, frozen)
        residuals.values[:, SENSOR_COLUMNS] = sensors
        alone = np.empty(len(rows), dtype=bool)
        alone[:] = np.isnan(residuals.signals.commanded_voltage_v)
        usable, trusted, turned = self._judge_voltage(residuals, alone)
        # A filter bridges what was not read by itself.
        seen = rows if read else np.where(_IS_PREDICTED, np.nan, rows)
        told = self._estimate.step(seen, usable, frozen, residuals.values)
        if not usable.all():
            residuals.leave_out(~usable, VOLTAGE_COLUMNS)
        self._distrust_speed(residuals)
        if self._lost.leave_out(residuals, read):
            self._estimate.interrupt()
        self._learn(residuals, int(stamps_ns[0]))
        found = self._regressors(rows, residuals)
        residuals.values[:, self._withheld] = np.nan
        results = self._detector.step(residuals)
        results.z[:, SENSOR_COLUMNS], results.k[:, SENSOR_COLUMNS] = sensors, self._sensors.k
        # The zero of a voltage that nothing corroborates is data quality, not a symptom;
        # what alternates with the motion (direction-normalised) still is one.
        results.z[alone, ELECTRICAL] = np.nan
        self._shifts.step(residuals, results, alone)
        return Tested(residuals, results, found, trusted, turned, told)

    def _test_sensors(self, stamps_ns: Stamps, rows: Array) -> tuple[Array, Array]:
        """Readings that may be used, and the tests of each sensor by itself.

        A lost scan is a row of nothing to them: a step across it is none.
        """
        before_ns, self._last_ns = self._last_ns, int(stamps_ns[-1])
        if len(rows) == 1 and self._last_ns - before_ns < 1.5 * self._period_ns:
            tested = self._sensors.step(rows)
            return tested.usable, tested.z
        apart = (stamps_ns - np.append(before_ns, stamps_ns[:-1])) / self._period_ns
        places = np.cumsum(np.clip(np.rint(apart), 1, 2 * SPAN).astype(np.int64)) - 1
        if places[-1] + 1 == len(rows):
            tested = self._sensors.step(rows)
            return tested.usable, tested.z
        whole = np.full((int(places[-1]) + 1, rows.shape[1]), np.nan)
        whole[places] = rows
        tested = self._sensors.step(whole)
        return tested.usable[places], tested.z[places]

    def _judge_voltage(self, residuals: ResidualRows, alone: Flags) -> tuple[Flags, Flags, int]:
        """Whether what rests on the voltage may be used, where motion alone can belie it.

        With that whether the voltage was trusted before each scan, and the first scan with
        which it lost that trust, or n.
        """
        electrical = np.where(alone, residuals.values[:, ELECTRICAL], np.nan)
        usable, was_bad = self._plausible.follow(electrical)
        turned = len(alone)
        if not usable.all():
            usable |= ~alone
            is_bad = np.append(was_bad[1:], self._plausible.bad)
            turned = int((is_bad & ~was_bad).argmax()) if (is_bad & ~was_bad).any() else turned
            if turned == 0:
                self._detector.forget(VOLTAGE_COLUMNS)
        return usable, ~was_bad, turned

    def _distrust_speed(self, residuals: ResidualRows) -> None:
        """A position that has just jumped reads as a speed for as long as the kernel sees it."""
        if self._bank.has_encoder:
            return
        jumped = np.abs(residuals.values[:, POSITION]) > 1.0
        if not self._speed_wait and not jumped.any():
            return
        wrong = np.array([self._reads_wrong(jump) for jump in jumped.tolist()])
        residuals.leave_out(wrong, SPEED_COLUMNS)
        residuals.moving[wrong] = False

    def _reads_wrong(self, jumped: bool) -> bool:
        if jumped:
            self._speed_wait = SPEED_SCANS
        wrong = self._speed_wait > 0
        self._speed_wait -= wrong
        return wrong

    def _learn(self, residuals: ResidualRows, stamp_ns: int) -> None:
        """Offsets of this unit, in the warm-up only."""
        if not self._learning:
            return
        if stamp_ns >= self._learn_until_ns:
            self._adopt_offsets(stamp_ns)
            return
        for name, learning in self._learning.items():
            limit = self._calibration.limit(name)
            if limit is not None:
                j = RESIDUAL_INDEX[name]
                values = residuals.values[residuals.moving, j]
                spread = residuals.spread[residuals.moving, SPREAD_ROWS.index(j)]
                learning.add(values, spread, limit.sigma[0] ** 2 * limit.correlation_samples)

    def _adopt_offsets(self, stamp_ns: int) -> None:
        found = {
            LEARNED[residual]: learning.offset()
            for residual, learning in self._learning.items()
            # What a bad channel says of its own offset is not to be learned.
            if not (LEARNED[residual] == "voltage_offset_v" and self._plausible.bad)
        }
        self._adopt(found)
        self.offsets = tuple(
            UnitOffset(name, getattr(self._p, name), sigma, stamp_ns)
            for name, (_, sigma) in found.items()
        )

    def _adopt(self, found: Mapping[str, tuple[float, float]]) -> None:
        """Go on with offsets that change by so much, with this sigma each."""
        tolerance = {name: getattr(self._calibration.tolerance, name) for name in UNIT_PARAMETERS}
        change = dict.fromkeys(UNIT_PARAMETERS, 0.0)
        for name, (by, sigma) in found.items():
            change[name], tolerance[name] = by, sigma
        self._learning = {}
        offsets = {name: getattr(self._p, name) + by for name, (by, _) in found.items()}
        self._p = replace(self._p, **offsets)
        self._bank.adopt(self._p)
        self._estimate.adopt(self._p)
        self._shifts.adopt(list(change.values()))
        self._detector.adopt(list(change.values()), list(tolerance.values()))
        # How an innovation moves with a parameter is known in size alone.
        self._detector.forget(list(INNOVATION_INDEX.values()))

    def _regressors(self, rows: Array, residuals: ResidualRows) -> Array:
        """Columns of ``REGRESSOR_NAMES``, shape (n, regressors)."""
        # What each temperature should read; the reading itself shares the residual's noise.
        apart = rows.take(_READ, axis=1) - residuals.values.take(_APART, axis=1)
        columns = apart[0].tolist() if len(rows) == 1 else apart.T
        expected = dict(zip(TEMPERATURES, columns, strict=True))
        found = regressors(self._p, residuals.signals, expected)
        table = np.empty((len(rows), len(REGRESSOR_NAMES)))
        table[:, -1] = residuals.moving
        if len(rows) == 1:
            table[0, :-1] = found
            return table
        for number, column in enumerate(found):
            table[:, number] = column
        return table
