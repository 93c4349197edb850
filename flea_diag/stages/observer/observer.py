"""Scans in; Residual, DataQuality, Detection and Symbols out. The verdict tells it of the past.

Order of work: is the stream whole (``stream_order``), is each channel to be trusted
(``channels``), what are the residuals and their tests (``residual_stream``), which symbols
follow (``deviation``). This stage keeps that order and makes the records.
"""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.residuals.residual_rows import INDEX, RESIDUALS, TEMPERATURES, ResidualRow
from flea_diag.core.sensors.unit_change import UnitChange
from flea_diag.stages.observer.channels import Channels, Reading
from flea_diag.stages.observer.detection_episode import Deviation
from flea_diag.stages.observer.residual_stream import REGRESSOR_NAMES, ResidualStream, Tested
from flea_diag.stages.observer.state_estimate import KINDS, NONE, StateEstimate
from flea_diag.stages.observer.stream_order import Place, StreamOrder
from flea_diag.wire.blocks import ResidualBlock, ScanBlock
from flea_diag.wire.parameters import parameter
from flea_diag.wire.records import (
    ANOTHER_UNIT,
    DRIVER_DEAD,
    AmbiguityGroup,
    ChannelQuality,
    ChannelTable,
    DataQuality,
    Quality,
    Record,
    Scan,
)

Array = npt.NDArray[np.float64]

LEAST_SCANS, MOST_SCANS = 16, 1024
"""Scans that are worth a block, and that one may hold."""
TEMPERATURE_COLUMNS = np.array([INDEX[name] for name in TEMPERATURES])


@dataclass(frozen=True)
class ObserverParameters:
    """What a user may set on the observer."""

    warm_up_s: float = parameter(
        6.0,
        "time at the start of a stream in which the unit's own sensor offsets are learned",
        unit="s",
        minimum=0.0,
        maximum=60.0,
    )
    rearm_after_s: float = parameter(
        30.0,
        "close an episode once every test has been quiet for so long (0: only by ~/reset)",
        unit="s",
        minimum=0.0,
        maximum=3600.0,
    )
    gap_scans: int = parameter(
        10, "missing scans after which smoothing starts anew", minimum=2, maximum=1000
    )
    state_observer: str = parameter(
        "particle",
        "what estimates the states for detection: particle or Kalman filter, or none (fastest)",
        choices=(*KINDS, NONE),
    )
    observer_backend: str = parameter(
        "auto", "what computes particle filter and tests", choices=("auto", "numpy", "numba")
    )
    observer_seed: int = parameter(
        1, "seed of the particle filter's random numbers", minimum=0, maximum=2**31 - 1
    )


@dataclass
class Checkpoint:
    """State to which the observer can go back, and the quiet blocks since then.

    A copy of the state takes as long as two scans, and short blocks come between those of
    vibration: so it is made now and then, and what has passed since is done once more.
    """

    state: tuple[StreamOrder, Channels, ResidualStream, Deviation, UnitChange]
    blocks: list[ScanBlock] = field(default_factory=list)
    scans: int = 0

    def take(self, block: ScanBlock) -> None:
        """One more quiet block."""
        self.blocks.append(block)
        self.scans += len(block)


class ObserverStage:
    """The detector of the diagnosis; see the module's first lines."""

    consumes: tuple[type, ...] = (ChannelTable, Scan, AmbiguityGroup)
    takes_blocks = True

    def __init__(self, calibration: Calibration, parameters: ObserverParameters) -> None:
        self._calibration = calibration
        self._parameters = parameters
        self._tested = np.array(
            [j for j, row in enumerate(RESIDUALS) if _is_tested(row, calibration)]
        )
        self._names = tuple(RESIDUALS[j].name for j in self._tested)
        self._table: ChannelTable | None = None
        self._verdict: AmbiguityGroup | None = None
        self._order = StreamOrder(round(calibration.period_s * 1e9), parameters.gap_scans)
        self._deviation = Deviation(parameters.rearm_after_s)
        self._unit = UnitChange()
        self._most = LEAST_SCANS
        self._checkpoint: Checkpoint | None = None
        self._start(0)

    def _start(self, stamp_ns: int) -> None:
        """Begin a stream: nothing of an earlier one is used any more."""
        c = self._calibration
        p, volts = self._parameters, f"{c.voltage_limit_v:.1f} V"
        distrust = f"disagrees with current and motion by more than {volts}"
        self._channels = Channels(c.channels, distrust, p.observer_backend)
        if self._table is not None:
            self._channels.take_ranges(self._table)
        estimate = StateEstimate(c, p.state_observer, p.observer_seed, p.observer_backend)
        self._stream = ResidualStream(c, estimate, p.warm_up_s, stamp_ns, p.observer_backend)
        if self._table is not None:
            self._stream.take_ranges(self._table)
        self._deviation.forget()
        self._unit.forget()

    def handle(self, record: Record) -> tuple[Record, ...]:
        """Records caused by a ChannelTable, a Scan or a verdict."""
        self._checkpoint = None
        if isinstance(record, Scan):
            return self._scan(record)
        if isinstance(record, ChannelTable):
            self._table = record
            self._channels.take_ranges(record)
            self._stream.take_ranges(record)
        elif isinstance(record, AmbiguityGroup):
            self._verdict = record
        learns, stamp_ns = self._stream.learns, self._order.last_ns
        taken_over = self._recall()
        if learns == self._stream.learns or stamp_ns is None:
            return taken_over
        return (self._say_quality(stamp_ns), *taken_over)

    def _recall(self) -> tuple[Record, ...]:
        """Take from the verdict what an observer before this one knew of the same run.

        That is what is older than the first scan, and younger than the channel table.
        """
        group, table, first_ns = self._verdict, self._table, self._order.first_ns
        if group is None or table is None or first_ns is None or not self._stream.learns:
            return ()
        past = range(table.stamp_ns, first_ns)
        offsets = tuple(offset for offset in group.offsets if offset.learned_ns in past)
        within = bool(group.episode) and group.detected_stamp_ns in past
        if offsets or within:
            self._stream.recall(offsets, within)
        if not within:
            return ()
        self._stream.turn(opened=True)
        return (self._deviation.take_over(group.detected_stamp_ns, group.episode),)

    def handle_block(self, block: ScanBlock) -> tuple[int, tuple[ResidualBlock, ...]]:
        """Take the leading scans that cause residuals and nothing else.

        Returns
        -------
        How many that are, and their residuals. What causes more is left to ``handle``; after
        that, blocks start small again, for one event seldom comes alone.
        """
        stamps_ns = block.stamps_ns[: self._most]
        count = min(self._order.leading(stamps_ns), self._stream.alike(stamps_ns))
        if count < min(LEAST_SCANS, len(block)):
            return 0, ()
        if self._checkpoint is None or self._checkpoint.scans >= MOST_SCANS:
            self._checkpoint = Checkpoint(
                deepcopy((self._order, self._channels, self._stream, self._deviation, self._unit))
            )
        part = block.part(slice(count))
        quiet, residuals = self._try(part)
        self._most = min(2 * self._most, MOST_SCANS)
        if quiet == count:
            self._checkpoint.take(part)
            return quiet, (residuals,)
        # Something happens: go back, and up to there.
        self._go_back(self._checkpoint)
        self._most = LEAST_SCANS
        if not quiet:
            return 0, ()
        _, residuals = self._try(block.part(slice(quiet)))
        return quiet, (residuals,)

    def _go_back(self, checkpoint: Checkpoint) -> None:
        """Return to the end of the last block that was taken."""
        self._order, self._channels, self._stream, self._deviation, self._unit = checkpoint.state
        self._checkpoint = None
        for block in checkpoint.blocks:
            self._try(block)

    def _try(self, block: ScanBlock) -> tuple[int, ResidualBlock]:
        """Residuals of scans in order, and the first scan that causes more, or their number."""
        self._order.follow(block.stamps_ns)
        reading = self._channels.read(block)
        tested, changed = self._test(block, reading)
        happens = self._deviation.follow(block.stamps_ns, tested.results)
        other = self._other_unit(reading)
        residuals = self._residuals(block, tested)
        return min(changed, tested.turned, happens, other), residuals

    def _other_unit(self, reading: Reading) -> int:
        """The first scan with which another unit is in use, or n."""
        return self._unit.follow(reading.usable.take(TEMPERATURE_COLUMNS, axis=1))

    def _test(self, block: ScanBlock, reading: Reading) -> tuple[Tested, int]:
        """Residuals and tests; and the first scan with which a channel changes, or n."""
        tested = self._stream.step(block.stamps_ns, reading.usable, self._deviation.is_open)
        return tested, self._channels.judge(block.stamps_ns, reading, tested.trusted)

    def _scan(self, scan: Scan) -> tuple[Record, ...]:
        place = self._order.step(scan.stamp_ns)
        if place is Place.PASSED_OVER:
            return ()
        recalled: tuple[Record, ...] = ()
        if place is Place.RESTART:
            self._start(scan.stamp_ns)
            recalled = self._recall()
        elif place is Place.AFTER_GAP:
            self._stream.interrupt()
        block = ScanBlock(np.array([scan.stamp_ns]), scan.channels, np.array([scan.values]))
        reading = self._channels.read(block)
        if self._other_unit(reading) == 0:
            return self._go_over(block, scan.stamp_ns)
        learned = self._stream.learns
        tested, changed = self._test(block, reading)
        learned &= not self._stream.learns
        was_open = self._deviation.is_open
        said = self._deviation.step(scan.stamp_ns, tested.results)
        if self._deviation.is_open != was_open:
            self._stream.turn(opened=not was_open)
        is_new = changed == 0 or learned or self._order.is_due(scan.stamp_ns)
        quality = (self._say_quality(scan.stamp_ns),) if is_new else ()
        return (*recalled, *quality, *self._residuals(block, tested).records(), *said)

    def _go_over(self, block: ScanBlock, stamp_ns: int) -> tuple[Record, ...]:
        """Another unit is in use: what was found on the last one ends, and all begins anew."""
        closed = self._deviation.close(stamp_ns, ANOTHER_UNIT)
        self._start(stamp_ns)
        tested, _ = self._test(block, self._channels.read(block))
        residuals = self._residuals(block, tested).records()
        return (self._say_quality(stamp_ns), *residuals, closed)

    def _residuals(self, block: ScanBlock, tested: Tested) -> ResidualBlock:
        results = tested.results
        return ResidualBlock(
            block.stamps_ns,
            self._names,
            tested.residuals.values.take(self._tested, axis=1),
            results.z.take(self._tested, axis=1),
            results.k.take(self._tested, axis=1),
            REGRESSOR_NAMES,
            tested.regressors,
            *tested.told,
        )

    def quality_record(self, stamp_ns: int) -> DataQuality:
        """State and counters of every channel and of the stream, as they are now."""
        return self._quality(stamp_ns, self._order.state())

    def _say_quality(self, stamp_ns: int) -> DataQuality:
        return self._quality(stamp_ns, self._order.say(stamp_ns))

    def _quality(self, stamp_ns: int, stream: ChannelQuality) -> DataQuality:
        if self._channels.driver_dead:
            stream = replace(stream, quality=Quality.BAD, reason=DRIVER_DEAD)
        channels = self._channels.states(self._stream.stuck)
        return DataQuality(stamp_ns, (stream, *channels), self._stream.offsets)

    def finish(self) -> tuple[Record, ...]:
        """The input has ended: what was counted and not yet said."""
        if not self._order.unsaid or self._order.last_ns is None:
            return ()
        return (self._say_quality(self._order.last_ns),)

    def reset(self) -> tuple[Record, ...]:
        """Close the open episode, if any, and arm again."""
        self._checkpoint = None
        if not self._deviation.is_open or self._order.last_ns is None:
            return ()
        self._stream.turn(opened=False)
        return (self._deviation.close(self._order.last_ns, "reset"),)


def _is_tested(row: ResidualRow, calibration: Calibration) -> bool:
    """Whether this stand has limits for a residual."""
    if row.gate == "sensor":
        return any(limit.has(row.name) for limit in calibration.sensors)
    return calibration.limit(row.name) is not None
