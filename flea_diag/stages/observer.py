"""Scan in; Residual, DataQuality, Detection and Symbols out.

Order of work for one scan: is the stream whole, is each channel to be trusted, what are the
residuals, does a test pass its limit, which symbols follow. All of it is core; this stage
keeps the order, the episode and the records.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from flea_diag.core import residual as relations
from flea_diag.core import symbols
from flea_diag.core.calibration import Calibration
from flea_diag.core.detection import Detector, TestResults
from flea_diag.core.fault_models import REGRESSORS
from flea_diag.core.plausibility import VoltagePlausibility
from flea_diag.core.quality import ChannelMonitor
from flea_diag.core.regressors import TEMPERATURES, regressors
from flea_diag.core.residual import SPEED
from flea_diag.core.residual_bank import (
    CHANNELS,
    INDEX,
    INNOVATION_INDEX,
    RESIDUAL_INDEX,
    RESIDUALS,
    ResidualBank,
    ResidualSample,
)
from flea_diag.core.symbols import SymbolState
from flea_diag.core.unit_offsets import OffsetLearning
from flea_diag.stages.state_estimate import KINDS, NONE, StateEstimate, Told
from flea_diag.wire.parameters import parameter
from flea_diag.wire.records import (
    ChannelQuality,
    ChannelTable,
    DataQuality,
    Detection,
    Quality,
    Record,
    Residual,
    Scan,
    Symbol,
    Symbols,
)

Array = npt.NDArray[np.float64]

KERNEL_LENGTH = 31
VOLTAGE_COLUMNS = [j for j, row in enumerate(RESIDUALS) if "motor_voltage" in row.needs]
INNOVATION_COLUMNS = list(INNOVATION_INDEX.values())
ISOLATING = np.array([row.isolates for row in RESIDUALS])
SPEED_COLUMNS = [j for j, row in enumerate(RESIDUALS) if SPEED in row.needs]
JUMP_SCANS = 9
"""Scans that the jump predictor looks back over: the longest a jump stays in it."""
STREAM = "sensors/slow"
LEARNED = {
    "parity_mechanical": "current_offset_a",
    "parity_electrical": "voltage_offset_v",
}
"""Which relation fixes which offset of this unit in the warm-up."""


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
        "auto", "what computes the particle filter", choices=("auto", "numpy", "numba")
    )
    observer_seed: int = parameter(
        1, "seed of the particle filter's random numbers", minimum=0, maximum=2**31 - 1
    )


class ObserverStage:
    """The detector of the diagnosis; see the module's first lines."""

    consumes: tuple[type, ...] = (ChannelTable, Scan)

    def __init__(self, calibration: Calibration, parameters: ObserverParameters) -> None:
        self._calibration = calibration
        self._parameters = parameters
        self._period_ns = round(calibration.period_s * 1e9)
        self._tested = [
            j for j, row in enumerate(RESIDUALS) if calibration.limit(row.name) is not None
        ]
        self._names = tuple(RESIDUALS[j].name for j in self._tested)
        self._ranges: dict[str, tuple[float, float]] = {}
        self._episodes = 0
        self._stream = dict.fromkeys(("samples", "late", "duplicate", "lost"), 0)
        self._start(None)

    def _start(self, stamp_ns: int | None) -> None:
        """Begin a stream: nothing of an earlier one is used any more."""
        c = self._calibration
        self._first_ns = stamp_ns
        self._last_ns = stamp_ns
        self._p = c.parameters
        self._bank = ResidualBank(c.parameters, period_s=c.period_s, kernel_length=KERNEL_LENGTH)
        self._detector = Detector(
            c.limits, c.tolerances(), c.tolerance.noise_log, c.tolerance.thermal_rate_k_per_s
        )
        self._plausible = VoltagePlausibility(c.voltage_limit_v)
        p = self._parameters
        self._estimate = StateEstimate(c, p.state_observer, p.observer_seed, p.observer_backend)
        self._learning = {
            residual: (name, OffsetLearning(name, c.tolerance))
            for residual, name in LEARNED.items()
        }
        self._monitors = {name: self._monitor(name) for name in CHANNELS if name in c.channels}
        self._said: tuple[tuple[str, str], ...] = ()
        self._symbols: dict[int, SymbolState] = {}
        self._detected_ns = -1
        self._quiet_since_ns = -1
        self._speed_wait = 0

    def _monitor(self, channel: str) -> ChannelMonitor:
        low, high = self._ranges.get(channel, (-math.inf, math.inf))
        return ChannelMonitor(channel, low, high)

    def handle(self, record: Record) -> tuple[Record, ...]:
        """Records caused by a ChannelTable or a Scan."""
        if isinstance(record, ChannelTable):
            self._ranges = {row.name: (row.minimum, row.maximum) for row in record.channels}
            for name, monitor in self._monitors.items():
                monitor.minimum, monitor.maximum = self._ranges.get(name, (-math.inf, math.inf))
            return ()
        if isinstance(record, Scan):
            return self._scan(record)
        return ()

    def reset(self) -> tuple[Record, ...]:
        """Close the open episode, if any, and arm again."""
        if self._detected_ns < 0 or self._last_ns is None:
            return ()
        return self._close(self._last_ns, "reset")

    # --- one scan ---------------------------------------------------------------------

    def _scan(self, scan: Scan) -> tuple[Record, ...]:
        if not self._in_order(scan.stamp_ns):
            return ()
        row = self._usable_row(scan)
        frozen = self._detected_ns >= 0
        sample = self._bank.step(row, frozen)
        usable = self._voltage_usable(sample)
        told = self._estimate.step(row, usable, frozen, sample.values)
        if not usable:
            sample.values[VOLTAGE_COLUMNS] = np.nan
        self._distrust_speed(sample)
        self._learn(sample, scan.stamp_ns)
        results = self._detector.step(sample)
        if math.isnan(sample.signals.commanded_voltage_v):
            # The zero of a voltage that nothing corroborates is data quality, not a symptom;
            # what alternates with the motion (direction-normalised) still is one.
            results.z[RESIDUAL_INDEX["parity_electrical"]] = math.nan
        out: list[Record] = [*self._quality(scan.stamp_ns)]
        out.append(self._residual(scan.stamp_ns, row, sample, results, told))
        out.extend(self._episode(scan.stamp_ns, results))
        return tuple(out)

    def _in_order(self, stamp_ns: int) -> bool:
        """Whether this scan carries the stream on; counts what was late, twice or lost."""
        self._stream["samples"] += 1
        if self._last_ns is None:
            self._first_ns = self._last_ns = stamp_ns
            return True
        ahead = stamp_ns - self._last_ns
        if ahead == 0:
            self._stream["duplicate"] += 1
            return False
        if ahead < 0:
            self._stream["late"] += 1
            if ahead < -1_000_000_000:
                self._start(stamp_ns)
                return True
            return False
        missing = round(ahead / self._period_ns) - 1
        self._stream["lost"] += max(missing, 0)
        if missing >= self._parameters.gap_scans:
            self._bank.interrupt()
            self._estimate.interrupt()
        self._last_ns = stamp_ns
        return True

    def _usable_row(self, scan: Scan) -> Array:
        row = np.full(len(CHANNELS), np.nan)
        for name, value in zip(scan.channels, scan.values, strict=True):
            monitor = self._monitors.get(name)
            if monitor is not None:
                trusted = name != "motor_voltage" or not self._plausible.bad
                row[INDEX[name]] = monitor.step(
                    scan.stamp_ns,
                    value,
                    trusted,
                    "disagrees with current and motion by more than "
                    f"{self._calibration.voltage_limit_v:.1f} V",
                )
        for name, monitor in self._monitors.items():
            if name not in scan.channels:
                monitor.step(scan.stamp_ns, math.nan, True, "")
        return row

    def _voltage_usable(self, sample: ResidualSample) -> bool:
        """Whether what rests on the voltage may be used, where motion alone can belie it."""
        if not math.isnan(sample.signals.commanded_voltage_v):
            return True
        was_bad = self._plausible.bad
        usable = self._plausible.step(float(sample.values[RESIDUAL_INDEX["parity_electrical"]]))
        if self._plausible.bad and not was_bad:
            self._detector.forget(VOLTAGE_COLUMNS)
        return usable

    def _distrust_speed(self, sample: ResidualSample) -> None:
        """A position that has just jumped reads as a speed for as long as the kernel sees it."""
        if self._bank.has_encoder:
            return
        limit = self._calibration.limit("actuator_position")
        jump = abs(sample.values[RESIDUAL_INDEX["actuator_position"]])
        if limit is not None and jump > limit.windows[0].k * limit.windows[0].sigma[0]:
            self._speed_wait = KERNEL_LENGTH + JUMP_SCANS
        if self._speed_wait > 0:
            self._speed_wait -= 1
            sample.values[SPEED_COLUMNS] = np.nan
            sample.moving = False

    def _learn(self, sample: ResidualSample, stamp_ns: int) -> None:
        """Offsets of this unit, in the warm-up only."""
        if self._first_ns is None or not self._learning:
            return
        if stamp_ns - self._first_ns >= self._parameters.warm_up_s * 1e9:
            self._adopt_offsets()
            return
        for name, (_, learning) in self._learning.items():
            limit = self._calibration.limit(name)
            if limit is not None and sample.moving:
                j = RESIDUAL_INDEX[name]
                variance = limit.sigma[0] ** 2 * limit.correlation_samples
                learning.add(float(sample.values[j]), sample.spread[j], variance)

    def _adopt_offsets(self) -> None:
        tolerance = {
            name: getattr(self._calibration.tolerance, name) for name in relations.UNIT_PARAMETERS
        }
        change = dict.fromkeys(relations.UNIT_PARAMETERS, 0.0)
        for parameter_name, learning in self._learning.values():
            # What a bad channel says of its own offset is not to be learned.
            if parameter_name == "voltage_offset_v" and self._plausible.bad:
                continue
            change[parameter_name], tolerance[parameter_name] = learning.offset()
        self._learning = {}
        offsets = {name: getattr(self._p, name) + change[name] for name in LEARNED.values()}
        self._p = replace(self._p, **offsets)
        self._bank.adopt(self._p)
        self._estimate.adopt(self._p)
        self._detector.adopt(list(change.values()), list(tolerance.values()))
        # How an innovation moves with a parameter is known in size alone.
        self._detector.forget(INNOVATION_COLUMNS)

    # --- records ----------------------------------------------------------------------

    def _quality(self, stamp_ns: int) -> tuple[Record, ...]:
        said = tuple((name, m.state.quality) for name, m in self._monitors.items())
        if said == self._said:
            return ()
        self._said = said
        return (self.quality_record(stamp_ns),)

    def quality_record(self, stamp_ns: int) -> DataQuality:
        """State and counters of every channel and of the stream, as they are now."""
        stream = ChannelQuality(
            STREAM, Quality.GOOD, self._first_ns or 0, "", tuple(self._stream.items())
        )
        channels = (
            ChannelQuality(
                name,
                Quality(m.state.quality),
                m.state.since_ns,
                m.state.reason,
                tuple(m.counters.items()),
            )
            for name, m in self._monitors.items()
        )
        return DataQuality(stamp_ns, (stream, *channels))

    def _residual(
        self, stamp_ns: int, row: Array, sample: ResidualSample, results: TestResults, told: Told
    ) -> Residual:
        return Residual(
            stamp_ns,
            self._names,
            tuple(sample.values[self._tested].tolist()),
            tuple(results.z[self._tested].tolist()),
            tuple(results.k[self._tested].tolist()),
            REGRESSOR_NAMES,
            (*regressors(self._p, sample.signals, _expected(row, sample)), float(sample.moving)),
            told.channels,
            told.estimates,
            told.sigmas,
            told.health,
        )

    # --- episode ----------------------------------------------------------------------

    def _episode(self, stamp_ns: int, results: TestResults) -> tuple[Record, ...]:
        deviating = results.deviating()
        if self._detected_ns < 0:
            return self._open(stamp_ns, results, deviating) if deviating.any() else ()
        changed = False
        for column in np.flatnonzero(deviating & ISOLATING):
            if int(column) not in self._symbols:
                j = int(column)
                self._symbols[j] = symbols.crossed(float(results.z[j]), stamp_ns)
                changed = True
        for j, state in tuple(self._symbols.items()):
            renewed = symbols.later(state, float(results.z[j]), stamp_ns)
            changed = changed or renewed is not state
            self._symbols[j] = renewed
        out: tuple[Record, ...] = (self._symbol_record(stamp_ns),) if changed else ()
        return out + self._rearm(stamp_ns, results)

    def _open(
        self, stamp_ns: int, results: TestResults, deviating: npt.NDArray[np.bool_]
    ) -> tuple[Record, ...]:
        self._episodes += 1
        self._detected_ns = stamp_ns
        self._quiet_since_ns = -1
        self._symbols = {
            int(j): symbols.crossed(float(results.z[j]), stamp_ns)
            for j in np.flatnonzero(deviating & ISOLATING)
        }
        first = max(
            map(int, np.flatnonzero(deviating)), key=lambda j: abs(results.z[j]) / results.k[j]
        )
        detection = Detection(
            stamp_ns,
            self._episodes,
            True,
            RESIDUALS[first].name,
            float(results.z[first]),
            float(results.k[first]),
            f"mean of {results.window[first]} samples",
        )
        self._detector.forget(INNOVATION_COLUMNS)
        # An innovation detects and has no symbol: those of the relations follow.
        return (detection, self._symbol_record(stamp_ns)) if self._symbols else (detection,)

    def _symbol_record(self, stamp_ns: int) -> Symbols:
        rows = (
            Symbol(RESIDUALS[j].name, state.magnitude, state.slope, state.since_ns)
            for j, state in sorted(self._symbols.items(), key=lambda item: item[1].since_ns)
        )
        return Symbols(stamp_ns, self._episodes, tuple(rows))

    def _rearm(self, stamp_ns: int, results: TestResults) -> tuple[Record, ...]:
        with np.errstate(invalid="ignore"):
            quiet = not bool((np.abs(results.z) > 0.7 * results.k).any())
        if not quiet:
            self._quiet_since_ns = -1
        elif self._quiet_since_ns < 0:
            self._quiet_since_ns = stamp_ns
        wait_ns = self._parameters.rearm_after_s * 1e9
        if quiet and 0 < wait_ns <= stamp_ns - self._quiet_since_ns:
            return self._close(stamp_ns, "quiet")
        return ()

    def _close(self, stamp_ns: int, why: str) -> tuple[Record, ...]:
        self._detected_ns = -1
        self._symbols = {}
        self._detector.clear()
        return (Detection(stamp_ns, self._episodes, False, "", math.nan, math.nan, why),)


REGRESSOR_NAMES = (*REGRESSORS, "moving")


def _expected(row: Array, sample: ResidualSample) -> dict[str, float]:
    """What each temperature should read; the reading itself shares the residual's noise."""
    return {
        name: float(row[INDEX[name]] - sample.values[RESIDUAL_INDEX[name]]) for name in TEMPERATURES
    }
