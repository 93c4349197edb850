"""Detection, Symbols and Residual in; AmbiguityGroup and FeatureRequest out.

One episode: the first deviation makes the hypotheses, later symbols and likelihoods drop
some, and while several are left the next best feature is asked for, one at a time, until one
is left or nothing can split them. Everything is decided by record stamps, in merged order.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

from flea_diag.core.fault_models import DRIVE, REGRESSORS, plant_models
from flea_diag.core.feature_choice import FeatureChooser, refine
from flea_diag.core.isolation import Isolation
from flea_diag.core.likelihood import Evidence
from flea_diag.core.operating_point import QUADRANTS, Quadrant
from flea_diag.core.sensor_models import sensor_models
from flea_diag.core.sentinel import Sentinel
from flea_diag.stages.episode import SPEED, Episode
from flea_diag.stages.inquiry import Inquiry, Pace
from flea_diag.stages.isolator_parameters import IsolatorParameters, Knowledge
from flea_diag.stages.merge import Merge
from flea_diag.stages.verdict import Standing, Verdict, mismatch
from flea_diag.wire.records import (
    NEVER_NS,
    ChannelTable,
    DataQuality,
    Detection,
    FeatureValue,
    Quality,
    Record,
    Residual,
    Symbols,
    VibrationLevel,
)

__all__ = ["IsolatorParameters", "IsolatorStage", "Knowledge"]

Array = npt.NDArray[np.float64]

WEIGHED = (
    "parity_mechanical",
    "parity_electrical",
    "parity_drive",
    "parity_kinematic",
    "parity_speed",
    "motor_temperature",
    "nut_temperature",
    "ambient_temperature",
)
"""Residuals that the quantitative fault models explain."""
MOTION_ONLY = ("parity_mechanical",)
LEVEL_DELAY_NS = 150_000_000
"""From the end of a block until the smoothed speed of that time is known: half a kernel."""
WEIGH_EVERY_NS = 500_000_000
IDLE_A = 0.1
"""Below this the sign of a current is that of its noise."""


class IsolatorStage:
    """See the module's first lines."""

    consumes: tuple[type, ...] = (
        ChannelTable,
        DataQuality,
        Residual,
        Detection,
        Symbols,
        VibrationLevel,
        FeatureValue,
    )

    def __init__(self, knowledge: Knowledge, parameters: IsolatorParameters) -> None:
        self._k = knowledge
        self._p = parameters
        fitted = knowledge.calibration.parameters
        self._chooser = FeatureChooser(knowledge.features, parameters.strategy)
        self._merge = Merge(
            Residual, round(parameters.watermark_s * 1e9), round(parameters.answer_limit_s * 1e9)
        )
        limits = knowledge.calibration.limits
        self._sigma = {limit.name: limit.sigma[0] for limit in limits}
        self._correlation = {limit.name: limit.correlation_samples for limit in limits}
        self._weighed = tuple(name for name in WEIGHED if name in self._sigma)
        # A fault that moves none of this stand's relations cannot be weighed on it.
        self._models = tuple(
            model
            for model in plant_models(fitted) + sensor_models(fitted, DRIVE in self._weighed)
            if any(term.residual in self._weighed for term in model.terms)
        )
        self._verdict = Verdict(knowledge, parameters, self._models, self._weighed)
        self._standing = Standing()
        self._episodes = 0
        self._told = 0
        self._episode: Episode | None = None
        self._levels: deque[VibrationLevel] = deque(maxlen=100)
        self._sentinel = Sentinel(knowledge.features.nominal)
        self._window_ns = round(parameters.feature_window_s * 1e9)
        self._pace = Pace(self._window_ns)
        self._visited: deque[tuple[Quadrant, ...]] = deque(maxlen=400)
        self._said: tuple[object, ...] = ()

    def handle(self, record: Record) -> tuple[Record, ...]:
        """Records caused by one more input, once its turn in the merged order has come."""
        self._merge.push(record)
        return self._drain(everything=False)

    def finish(self) -> tuple[Record, ...]:
        """The input has ended: everything that still waits has its turn."""
        self._merge.hold(None)
        return self._drain(everything=True)

    def reset(self) -> tuple[Record, ...]:
        """Close the open episode, also one that vibration opened, and arm again."""
        if self._episode is None:
            return ()
        self._episode = None
        self._sentinel.clear()
        self._merge.hold(None)
        return self._say(self._merge.now_ns)

    def _drain(self, everything: bool) -> tuple[Record, ...]:
        out: list[Record] = []
        while (record := self._merge.pop(everything)) is not None:
            out.extend(self._take(record))
        return tuple(out)

    def _take(self, record: Record) -> Iterable[Record]:
        if isinstance(record, Residual):
            return self._residual(record)
        if isinstance(record, Symbols):
            return self._symbols(record)
        if isinstance(record, Detection):
            return self._detection(record)
        if isinstance(record, FeatureValue):
            return self._feature(record)
        if isinstance(record, VibrationLevel):
            self._levels.append(record)
            return ()
        if isinstance(record, DataQuality):
            return self._data_quality(record)
        if isinstance(record, ChannelTable):
            self._standing.axes = tuple(
                row.name for row in record.channels if row.name.startswith("accelerometer")
            )
            self._standing.mismatch = mismatch(self._k.calibration, record)
        return ()

    # --- what arrives -----------------------------------------------------------------

    def _data_quality(self, record: DataQuality) -> Iterable[Record]:
        unusable = (Quality.BAD, Quality.STALE, Quality.ABSENT)
        self._standing.bad = tuple(
            row.channel for row in record.channels if row.quality in unusable
        )
        return self._say(record.stamp_ns)

    def _detection(self, record: Detection) -> Iterable[Record]:
        self._told = record.episode
        if record.detected and self._episode is None:
            # The symbols of the same scan come next, and make the first group.
            self._open(record.stamp_ns)
            return ()
        if not record.detected and self._episode is not None:
            self._episode = None
            self._merge.hold(None)
            return self._say(record.stamp_ns)
        return ()

    def _open(self, stamp_ns: int) -> Episode:
        self._episodes += 1
        isolation = Isolation(self._k.faults, self._k.signatures)
        inquiry = Inquiry(stamp_ns, self._window_ns, self._p.feature_windows)
        self._episode = Episode(
            self._episodes, stamp_ns, isolation, Evidence(self._weighed), inquiry
        )
        return self._episode

    def _symbols(self, record: Symbols) -> Iterable[Record]:
        episode = self._episode
        if episode is None or record.episode < self._told:
            return ()  # an isolator that starts late is told of earlier episodes, too
        visited = {quadrant for scan in self._visited for quadrant in scan}
        if not self._p.gating:
            visited = set(QUADRANTS)
        for symbol in record.symbols:
            seen = (symbol.residual, symbol.magnitude, symbol.slope)
            if seen not in episode.symbols:
                episode.symbols += (seen,)
                episode.isolation.observe(
                    record.stamp_ns,
                    *seen,
                    quadrants=[q for q in QUADRANTS if q in visited] or QUADRANTS,
                    settled=episode.settled,
                )
        return self._say(record.stamp_ns)

    def _residual(self, record: Residual) -> Iterable[Record]:
        if self._standing.first_ns == NEVER_NS:
            self._standing.first_ns = record.stamp_ns
        if not (record.health and record.health[-1]):
            self._standing.lost_ns = NEVER_NS
        elif self._standing.lost_ns == NEVER_NS:
            self._standing.lost_ns = record.stamp_ns
        at = {name: index for index, name in enumerate(record.names)}
        regressors = np.array(record.regressors[: len(REGRESSORS)])
        moving = record.regressors[-1] > 0.5
        values = np.array(
            [
                record.values[at[name]]
                if name in at and (moving or name not in MOTION_ONLY)
                else math.nan
                for name in self._weighed
            ]
        )
        self._motion(record.stamp_ns, regressors, moving)
        raised = self._level(record.stamp_ns)
        episode = self._episode
        if episode is None or raised:
            return raised or self._say(record.stamp_ns)
        if record.stamp_ns - episode.start_ns >= self._p.onset_s * 1e9:
            episode.learn(record.stamp_ns, values, regressors)
            episode.moving += moving
        return self._weigh(record.stamp_ns, episode)

    def _motion(self, stamp_ns: int, regressors: Array, moving: bool) -> None:
        current = regressors[REGRESSORS.index("current_a")]
        speed = regressors[SPEED]
        lead = self._k.calibration.parameters.encoder_m_per_rad
        screw_rad_s = float(speed) / lead if lead else math.nan
        self._pace.add(stamp_ns, screw_rad_s)
        self._sentinel.motion(screw_rad_s, float(regressors[REGRESSORS.index("load_n")]))
        if moving:
            self._standing.moved += 1
            self._standing.moved_ns = stamp_ns
            self._visited.append(_quadrants(float(current), float(speed)))

    def _weigh(self, stamp_ns: int, episode: Episode) -> Iterable[Record]:
        """Every half second of evidence: likelihoods, and whether the slow channels are done."""
        due = round((stamp_ns - episode.start_ns) / WEIGH_EVERY_NS)
        if due == episode.weighed_at:
            return ()
        episode.weighed_at = due
        if not episode.symbols and not episode.settled:
            return ()  # the observer's innovation detected; no relation has deviated yet
        alive = {h.name for h in episode.isolation.alive()}
        models = [model for model in self._models if model.fault in alive]
        if self._p.likelihood and models and episode.symbols and episode.scans:
            fits = episode.likelihood.fit(
                models, self._sigma, self._correlation, self._k.calibration.tolerances()
            )
            conclusive = episode.conclusive() or not self._p.gating
            limit = self._p.drop_nats if conclusive else math.inf
            episode.isolation.weigh(stamp_ns, fits, limit)
        waited = (stamp_ns - episode.start_ns) / 1e9 >= self._p.settle_s
        if waited or episode.moving >= self._p.settle_samples:
            episode.settled = True
        if episode.settled and episode.symbols:
            episode.isolation.require(stamp_ns, episode.magnitudes(), episode.moved_channels())
        return self._go_on(stamp_ns)

    def _level(self, stamp_ns: int) -> Iterable[Record]:
        """A vibration level out of its nominal range opens an episode of its own.

        A block is judged once the smoothed speed of the same time is known.
        """
        if not self._levels or self._levels[0].stamp_ns + LEVEL_DELAY_NS > stamp_ns:
            return ()
        level = self._levels.popleft()
        axis = self._sentinel.step(level.axes, level.std)
        if axis is None or self._episode is not None:
            return ()
        episode = self._open(stamp_ns)
        for hypothesis in episode.isolation.alive():
            if not hypothesis.fault.vibration:
                hypothesis.why_dropped = (
                    f"{axis} left its range, and this fault does not show in vibration"
                )
        episode.settled = True
        episode.isolation.share_out()
        return self._go_on(stamp_ns)

    # --- features ---------------------------------------------------------------------

    def _go_on(self, stamp_ns: int) -> Iterable[Record]:
        """Ask for what is to be asked first: a group that waits for an answer is not final."""
        asked = self._ask(stamp_ns)
        return [*self._say(stamp_ns), *asked]

    def _ask(self, stamp_ns: int) -> Iterable[Record]:
        """Request the next best feature, if one can split the group that is left."""
        episode = self._episode
        if episode is None or not episode.settled or not self._standing.axes:
            return ()
        inquiry = episode.inquiry
        if inquiry.request is not None:
            return ()
        group = {h.name: h.probability for h in episode.isolation.alive()}
        inquiry.plan(group, self._chooser)
        if not inquiry.wanted or not inquiry.is_fresh(stamp_ns) or not self._pace.is_moving:
            return ()
        episode.step += 1
        self._merge.hold(stamp_ns + round(self._p.answer_budget_s * 1e9))
        return (inquiry.ask(stamp_ns, episode.number, episode.step),)

    def _feature(self, record: FeatureValue) -> Iterable[Record]:
        episode = self._episode
        if episode is None or not episode.inquiry.take(record):
            return ()
        self._merge.hold(None)
        if record.symbol != "?":
            group = {h.name: h.probability for h in episode.isolation.alive()}
            left = refine(group, self._k.features, record.feature, record.symbol)
            episode.isolation.believe(record.stamp_ns, record.feature, record.symbol, left)
        return self._go_on(record.stamp_ns)

    def _give_up(self, stamp_ns: int) -> None:
        """A feature whose answer never came is taken as not computable."""
        inquiry = self._episode.inquiry if self._episode is not None else None
        if inquiry is None or inquiry.request is None:
            return
        if stamp_ns - inquiry.request.stamp_ns > self._p.answer_limit_s * 1e9:
            inquiry.give_up()
            self._merge.hold(None)

    def _say(self, stamp_ns: int) -> tuple[Record, ...]:
        """The ambiguity group, if it or its outcome has changed."""
        self._give_up(stamp_ns)
        episode = self._episode
        outcome, _ = self._verdict.outcome(stamp_ns, self._standing, episode)
        number = episode.number if episode is not None else 0
        names = tuple(h.name for h in episode.isolation.alive()) if episode is not None else ()
        state = (outcome, number, names, self._standing.bad)
        if state == self._said:
            return ()
        if episode is not None and self._said[:1] and self._said[1] == number:
            episode.step += 1
        self._said = state
        return (self._verdict.record(stamp_ns, self._standing, episode),)


def _quadrants(current_a: float, speed_m_s: float) -> tuple[Quadrant, ...]:
    """Quadrants that a scan lies in; a current within its noise lies in both of its signs."""
    if not math.isfinite(current_a):
        return ()
    signs = (-1, 1) if abs(current_a) < IDLE_A else (1 if current_a > 0 else -1,)
    return tuple(Quadrant(sign, 1 if speed_m_s > 0 else -1) for sign in signs)
