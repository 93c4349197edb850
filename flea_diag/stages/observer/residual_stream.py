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

"""Residuals of one stream of scans and their tests, in the order of ``ResidualStream._follow``.

Each step is a file of its own.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.conditions.envelope_watch import ANYWHERE, EnvelopeWatch
from flea_diag.core.detection.detection import TestResults
from flea_diag.core.likelihood.effect_set import EffectSet
from flea_diag.core.likelihood.run_parameters import free_terms
from flea_diag.core.residual_values import ResidualRows
from flea_diag.core.residuals.parameters import ActuatorParameters
from flea_diag.core.residuals.residual_bank import ResidualBank
from flea_diag.core.sensors.reading_jump import ReadingJumps
from flea_diag.stages.judgement.ledger import JudgementLedger
from flea_diag.stages.judgement.tested import tested_names
from flea_diag.stages.observer.condition_watch import ConditionWatch
from flea_diag.stages.observer.mode_watch import ModeWatch
from flea_diag.stages.observer.regressor_table import Answer, RegressorTable
from flea_diag.stages.observer.residual_tests import ResidualTests, SensorTestsAlone
from flea_diag.stages.observer.sensor_validation import SensorValidation
from flea_diag.stages.observer.speed_trust import SpeedTrust
from flea_diag.stages.observer.state_estimate import ObserverOutput, StateEstimate
from flea_diag.stages.observer.supply_band import SupplyBands
from flea_diag.stages.observer.voltage_trust import VoltageTrust, VoltageVerdict
from flea_diag.stages.observer.warm_up import Offsets, RunWatch, WarmUp
from flea_diag.stages.stream.last_readings import LastReadings
from flea_diag.stages.stream.stream_order import AHEAD_NS
from flea_diag.wire.blocks import ResidualBlock
from flea_diag.wire.records import (
    NEVER_NS,
    OTHER_UNIT,
    OUTSIDE_CALIBRATION,
    ChannelQuality,
    ChannelTable,
    Quality,
    UnitOffset,
)

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Stamps = npt.NDArray[np.int64]


@dataclass(slots=True)
class StreamOutput:
    """Residuals, test results, regressors, voltage trust and estimates of n scans.

    ``turn``: the first scan with which a condition begins or ends, or a test is no longer judged,
    or n; later ones do not count. ``records``: see ``ResidualRecords``.
    """

    residuals: ResidualRows
    results: TestResults
    regressors: Array
    voltage: VoltageVerdict
    estimate: ObserverOutput
    turn: int
    records: ResidualBlock | None = None


class ResidualStream:
    """Residuals of one stream and their tests; takes scans singly or in blocks, after ``begin``."""

    def __init__(
        self,
        calibration: Calibration,
        effects: EffectSet,
        estimate: StateEstimate,
        warm_up_s: float,
        backend: str,
        answers: Sequence[Answer] | None,
        tests: ResidualTests | SensorTestsAlone,
    ) -> None:
        c, relations, known = calibration, effects.relations, effects.residuals
        self._sensor_columns = known.sensor_columns
        self._followed = [known.index[channel] for channel in known.predictions.values()]
        self._predictions = known.predicted_columns
        self._is_predicted = np.isin(known.channels, known.predicted)
        self._width = len(known.channels)
        self._p = c.parameters
        self._bank = ResidualBank(
            c.parameters,
            relations,
            period_s=c.period_s,
            counts=c.counts,
            backend=backend,
            most_supplied=c.envelope.supplies if c.envelope else {},
        )
        # The command corroborates the measured voltage, where the stand has it.
        signals, command = relations.signals, known.command
        self._command = signals.index(command) if command in signals else None
        # The zero of a mean voltage is that of its sensor; what is sampled off a bridge wanders.
        self._wanders = self._command is not None or c.voltage_sampling == "instant_pwm"
        self._sensors = SensorValidation(known, c, backend)
        self._voltage = VoltageTrust(known, c.voltage_limit_v, c.counts)
        self._estimate = estimate
        self._speed = SpeedTrust(known, self._bank.has_encoder, c.counts.kernel)
        self._last = LastReadings(self._width, c.counts.kernel // 2, backend)
        self._lost: Flags = np.zeros(c.counts.kernel, dtype=bool)
        self._loses = False
        self.conditions = ConditionWatch(c, relations)
        self.modes = ModeWatch(known)
        self._bands = SupplyBands(relations)
        self._outside_ns = NEVER_NS
        self.envelope = (
            EnvelopeWatch(c.envelope, relations, c.parameters, c.counts.kernel, c.period_s, backend)
            if c.envelope
            else None
        )
        self._warm_up: WarmUp | None = WarmUp(known, c, warm_up_s)
        terms = free_terms(relations)
        self._run = RunWatch(relations, terms, c) if terms else None
        self._regressors = RegressorTable(effects, c.parameters, answers)
        self._jumps = ReadingJumps([known.index[name] for name in effects.readings], c.counts)
        self._tests = tests
        self.offsets: tuple[UnitOffset, ...] = ()
        """Learned offsets of this unit; empty until the warm-up is over."""
        self._unit: tuple[ChannelQuality, ...] = ()
        self._period_ns = round(c.period_s * 1e9)
        self.ledger = JudgementLedger(known, tested_names(known, c), c.channels, c.counts)
        self.begun = False
        """Whether it has had its first scan."""
        self._last_ns = NEVER_NS

    def begin(self, stamp_ns: int) -> None:
        """The first scan is that of this stamp."""
        self.begun, self._last_ns = True, stamp_ns
        self.ledger.begin(stamp_ns)
        if self._warm_up is not None:
            self._warm_up.begin(stamp_ns)

    def take_ranges(self, table: ChannelTable) -> None:
        """Use the ranges of a channel table."""
        self._sensors.take_ranges(table)
        self.conditions.take_ranges(table)

    def leading(self, stamps_ns: Stamps) -> int:
        """How many of these scans may come in one block."""
        return self._warm_up.leading(stamps_ns) if self._warm_up else len(stamps_ns)

    def interrupt(self) -> None:
        """There is a gap before the next scan."""
        self._last.interrupt()
        self._bank.interrupt()
        self.conditions.interrupt()
        self._sensors.interrupt()
        self._estimate.interrupt()

    def recall(self, offsets: tuple[UnitOffset, ...], within: bool) -> None:
        """Take over the offsets learned earlier in this run, which ends the warm-up.

        ``within`` an episode nothing is learned, and thermal residuals are disabled until it is
        closed: the thermal nodes have started at readings that may be faulty.
        """
        if offsets:
            self._adopt({o.parameter: (o.value - getattr(self._p, o.parameter), o.sigma)
                         for o in offsets})  # fmt: skip
            self.offsets = offsets
        if within:
            self._warm_up = None
            self._tests.disable_thermal()

    @property
    def regressor_names(self) -> tuple[str, ...]:
        """Names of the columns of ``StreamOutput.regressors``."""
        return self._regressors.names

    @property
    def stuck(self) -> Mapping[str, int]:
        """Number of held readings of each channel."""
        return self._sensors.stuck

    @property
    def learns(self) -> bool:
        """Whether this is the warm-up."""
        return self._warm_up is not None

    def turn(self, opened: bool, by: TestResults | None = None) -> None:
        """An episode has opened, ``by`` these results where this stream has them, or closed."""
        self._tests.turn(opened, by)

    def step(self, stamps_ns: Stamps, raw: Array, given: Array, frozen: bool) -> StreamOutput:
        """Take n scans, SI, as they came and without values that are out of range.

        ``frozen`` stops corrections of estimates.
        """
        before_ns, self._last_ns = self._last_ns, int(stamps_ns[-1])
        if self._run is not None:
            self._adopt_run(self._run)
        rows, sensors = self._sensors.step(before_ns, stamps_ns, given)
        lost = round((int(stamps_ns[0]) - before_ns) / self._period_ns) - 1
        if lost > 0:
            self.ledger.lose(lost)
            known = min(lost, AHEAD_NS // self._period_ns)
            self._lose(before_ns + (lost - known) * self._period_ns, known, frozen)
        refused = None
        if self._sensors.withholds or given is not raw:
            self._voltage.withhold(given, rows)
            refused = np.isnan(rows) & ~np.isnan(raw)
            if self._sensors.outlying is not None:
                refused &= ~self._sensors.outlying
        output = self._follow(stamps_ns, rows, sensors, frozen, refused)
        if self._loses:
            self._count_lost(np.zeros(len(rows), dtype=bool))
        output.regressors[:, self._regressors.jumps] = self._jumps.step(given)
        return output

    def thaw(self, columns: Collection[int]) -> None:
        """In an episode: predictions and levels of these residuals go on from the next scan on."""
        self._bank.thaw(columns)
        self._tests.thaw(columns)

    def _lose(self, before_ns: int, count: int, frozen: bool) -> None:
        """Take lost scans as scans without a reading, of which no record is made.

        Of a pause so long that the clock may have been set only the last ones: how many there were
        is not known, the filters begin anew, and to take those of a night would take minutes.
        """
        stamps_ns = before_ns + np.arange(1, count + 1) * self._period_ns
        rows, sensors = (
            np.full((count, width), np.nan) for width in (self._width, len(self._sensors.k))
        )
        self._follow(stamps_ns, rows, sensors, frozen, read=False)
        self._count_lost(np.ones(count, dtype=bool))
        if 2 * np.count_nonzero(self._lost) > len(self._lost):
            # The filter bridges a few, and drifts over more.
            self._estimate.interrupt()

    def _count_lost(self, lost: Flags) -> None:
        """Which of the last scans, as many as a kernel has, are lost."""
        self._lost = np.append(self._lost, lost)[-len(self._lost) :]
        self._loses = bool(self._lost.any())

    def _follow(
        self, stamps_ns: Stamps, rows: Array, sensors: Array, frozen: bool,
        refused: Flags | None = None, read: bool = True,
    ) -> StreamOutput:  # fmt: skip
        """Take rows, shape (n, channels); ``refused`` are readings that are not to be used.

        None: none are. Not ``read``: the scans are lost.
        """
        held = self._last.step(rows, refused)
        residuals = self._bank.step(rows, frozen, held, refused)
        residuals.values[:, self._sensor_columns] = sensors
        alone = self._alone(residuals)
        voltage = self._voltage.judge(residuals, alone)
        if voltage.lost_at == 0:
            self._tests.forget(self._voltage.columns)
        turn = len(rows)
        if read:
            usable, away = voltage.usable, self._sensors.away
            turn = self.conditions.step(self._p, stamps_ns, held, residuals, usable, away)
            turn = min(turn, self.modes.step(stamps_ns, residuals.modes))
        if self.envelope is not None:
            turn = min(turn, self._place(self.envelope, stamps_ns, held, residuals))
        # The filter predicts through missing readings by itself, but not without its inputs.
        seen = rows if held is rows else np.where(self._is_predicted, rows, held)
        void = self.conditions.voids or self.modes.lost
        estimate = self._estimate.step(seen, voltage.usable, frozen, residuals.values, void)
        self.conditions.leave_out(residuals)
        voltage.leave_out(residuals)
        self._speed.leave_out(residuals)
        if self._run is not None:
            turn = min(turn, self._run.step(self._p, stamps_ns, residuals, frozen or not read))
            void = void or self._run.waits
        if self._warm_up is not None:
            if self.modes.voids:
                self._warm_up.begin(int(stamps_ns[-1]))
            self._learn(self._warm_up, residuals, int(stamps_ns[0]), frozen)
        self._bands.leave_out(residuals)
        # After the learning: the offsets of a unit are its own wherever it stands.
        if self.envelope is not None:
            self.envelope.leave_out(residuals)
        if refused is not None:
            # Readings that are told to be held were taken until then: their mean begins anew.
            residuals.begin_anew(refused[:, self._followed], self._predictions)
        regressors = self._regressors.rows(held, residuals)
        place = self.envelope.place if self.envelope is not None else ANYWHERE
        doubted = alone if self._wanders else None
        results = self._tests.step(residuals, (sensors, self._sensors.k), doubted, place)
        results.void = void
        if read:
            outside = self.envelope is not None and bool(self.envelope.outside)
            self.ledger.void_why = self._void_why
            told = self.ledger.take(
                stamps_ns, rows, residuals, results.z, void or self.modes.voids, outside
            )
            turn = min(turn, told)
        return StreamOutput(residuals, results, regressors, voltage, estimate, turn)

    def _alone(self, residuals: ResidualRows) -> Flags | None:
        """Scans whose voltage no command corroborates, shape (n,); None where there is none."""
        if self._command is None:
            return np.ones(len(residuals), dtype=bool)
        if len(residuals) == 1 and not math.isnan(residuals.signals.item(0, self._command)):
            return None  # the same without arrays
        alone = np.isnan(residuals.signals[:, self._command])
        return alone if np.count_nonzero(alone) else None

    def _place(
        self, envelope: EnvelopeWatch, stamps_ns: Stamps, rows: Array, residuals: ResidualRows
    ) -> int:
        """The first scan that changes whether this is outside the calibration, or n."""
        turn = envelope.step(rows, residuals)
        if envelope.turned:
            self._outside_ns = int(stamps_ns[turn])
        return turn

    @property
    def told(self) -> bool:
        """Whether the last scan has changed what is reported of conditions or of judgement."""
        placed = self.envelope is not None and self.envelope.turned
        return placed or self.ledger.turned or any(part.told for part in self._telling)

    @cached_property
    def _telling(self) -> tuple[ConditionWatch | ModeWatch | RunWatch, ...]:
        """What has rows of DataQuality of its own."""
        return self.conditions, self.modes, *((self._run,) if self._run else ())

    @property
    def _void_why(self) -> str:
        """Why relations are void, if not by a stop; empty otherwise."""
        if self._run is not None and self._run.waits:
            return "void while what this run has of its own is learned"
        return f"void in mode {self.modes.words}" if self.modes.voids else ""

    def states(self) -> tuple[ChannelQuality, ...]:
        """Rows of DataQuality: contact, modes, the unit, and a place outside the calibration."""
        rows = (*(row for part in self._telling for row in part.states()), *self._unit)
        if self.envelope is None or not self.envelope.outside:
            return rows
        words = self.envelope.words
        row = ChannelQuality(OUTSIDE_CALIBRATION, Quality.SATURATED, self._outside_ns, words)
        return (*rows, row)

    def _learn(self, warm_up: WarmUp, residuals: ResidualRows, stamp_ns: int, within: bool) -> None:
        """Adopt the offsets of this unit once the warm-up has estimated them.

        Of another unit than calibrated all that has shown is adopted, but ``within`` an episode.
        """
        found = warm_up.step(residuals, stamp_ns, self._voltage.lost)
        if found is None:
            return
        unit = warm_up.unit
        if unit.words:
            quality = Quality.SATURATED if unit.is_beyond else Quality.GOOD
            self._unit = (ChannelQuality(OTHER_UNIT, quality, stamp_ns, unit.words),)
        if unit.learned and not within:
            found = {**found, **unit.learned}
        self._adopt(found)
        self.offsets = tuple(
            UnitOffset(name, getattr(self._p, name), sigma, stamp_ns)
            for name, (_, sigma) in found.items()
        )

    def _adopt_run(self, run: RunWatch) -> None:
        """Use what this run has of its own, from the scan after the one that has shown it."""
        if any(getattr(self._p, name) != value for name, value in run.values.items()):
            self._use(replace(self._p, **run.values))
            if run.restarts:
                self._tests.restart(run.void)

    def _use(self, parameters: ActuatorParameters) -> None:
        """Use these parameters in every part that computes with them."""
        self._p = parameters
        self._bank.adopt(parameters)
        self._estimate.adopt(parameters)
        self._regressors.adopt(parameters)

    def _adopt(self, offsets: Offsets) -> None:
        """Use these offsets in every part; ends the warm-up."""
        self._warm_up = None
        moved = {name: getattr(self._p, name) + by for name, (by, _) in offsets.items()}
        self._use(replace(self._p, **moved))
        self._tests.adopt(offsets)
