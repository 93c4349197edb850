"""Detection, Symbols and Residual in; AmbiguityGroup and FeatureRequest out.

One episode: the first deviation makes the hypotheses, later symbols and likelihoods drop
some, and while several are left the next best feature is asked for, one at a time, until one
is left or nothing can split them. Everything is decided by record stamps, in merged order.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from flea_diag.core.calibration import Calibration
from flea_diag.core.fault import Fault
from flea_diag.core.fault_models import REGRESSORS, FaultModel, plant_models
from flea_diag.core.feature_choice import FeatureChooser, refine
from flea_diag.core.feature_table import FaultFeatureTable
from flea_diag.core.isolation import Hypothesis, Isolation
from flea_diag.core.likelihood import Evidence as Likelihood
from flea_diag.core.operating_point import QUADRANTS, Quadrant
from flea_diag.core.sensor_models import sensor_models
from flea_diag.core.sentinel import Sentinel
from flea_diag.core.signature import SignatureTable
from flea_diag.stages.merge import Merge
from flea_diag.wire.parameters import parameter
from flea_diag.wire.records import (
    NEVER_NS,
    AmbiguityGroup,
    Candidate,
    ChannelTable,
    DataQuality,
    Detection,
    Evidence,
    FeatureRequest,
    FeatureValue,
    Outcome,
    Quality,
    Record,
    Residual,
    Symbols,
    VibrationLevel,
)

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
ELAPSED, SPEED = REGRESSORS.index("elapsed_s"), REGRESSORS.index("speed_m_s")
EARLY_NS = 8_000_000_000
"""A deviation within this time of the stream's start was there before it."""
CONCLUSIVE_SAMPLES = 50
"""Scans of evidence before likelihoods may drop anything."""
LEVEL_DELAY_NS = 150_000_000
"""From the end of a block until the smoothed speed of that time is known: half a kernel."""
MOTION_CHANNELS = ("actuator_position", "motor_speed")
MOTION = [REGRESSORS.index(name) for name in ("position_rate_m_s", "encoder_m_s")]
"""Channels that say that the actuator moves, and the speeds that they say."""
MOVING_M_S = 0.010
BOTH_WAYS_SAMPLES = 30
"""Scans in each direction of motion before parity residuals may decide by likelihood."""
MOVED_SAMPLES = 50
"""So many scans in motion since the detection say that a channel still reads."""
NEEDED = ("motor_current", "load_force", "actuator_position")
"""Without these the stand shows too little of the actuator to say anything."""


@dataclass(frozen=True)
class IsolatorParameters:
    """What a user may set on the isolator."""

    watermark_s: float = parameter(
        0.2,
        "how long records wait for those of other topics",
        unit="s",
        minimum=0.0,
        maximum=5.0,
    )
    answer_budget_s: float = parameter(
        0.15, "stamp of a feature's answer after its request", unit="s", minimum=0.0, maximum=5.0
    )
    answer_limit_s: float = parameter(
        2.0, "give a feature up when no answer has come by then", unit="s", minimum=0.1, maximum=60
    )
    feature_window_s: float = parameter(
        1.0, "length of vibration that a feature is computed on", unit="s", minimum=0.1, maximum=5
    )
    onset_s: float = parameter(
        0.2,
        "scans this soon after the detection are no evidence: smoothing still shows the onset",
        unit="s",
        minimum=0.0,
        maximum=5.0,
    )
    settle_samples: int = parameter(
        200, "moving scans after the detection before features are asked for", minimum=1
    )
    settle_s: float = parameter(
        4.0, "the same as a time, for a stand that hardly moves", unit="s", minimum=0.1
    )
    drop_nats: float = parameter(
        3.5, "log-likelihood behind the best at which a fault is dropped", unit="1", minimum=0.1
    )
    explain_nats: float = parameter(
        3.0, "log-likelihood a fault must gain over no fault to explain anything", minimum=0.0
    )
    rest_s: float = parameter(
        60.0, "without motion for so long nothing is observable", unit="s", minimum=1.0
    )
    strategy: str = parameter(
        "optimal",
        "how the next feature is chosen",
        choices=("optimal", "information", "balanced", "paper"),
    )
    source: str = parameter("live", "what the verdicts rest on", choices=("live", "replay"))


@dataclass(frozen=True)
class Knowledge:
    """What the isolator knows before the first record."""

    calibration: Calibration
    calibration_sha256: str
    faults: Mapping[str, Fault]
    signatures: Mapping[Quadrant, SignatureTable]
    features: FaultFeatureTable


@dataclass
class _Episode:
    """State of one episode."""

    number: int
    start_ns: int
    isolation: Isolation
    likelihood: Likelihood
    step: int = 0
    moving: int = 0
    computed: tuple[str, ...] = ()
    request: FeatureRequest | None = None
    symbols: tuple[tuple[str, str, str], ...] = ()
    weighed_at: int = 0
    settled: bool = False
    scans: int = 0
    out: int = 0
    back: int = 0
    moved: npt.NDArray[np.int64] = field(default_factory=lambda: np.zeros(2, dtype=np.int64))

    def learn(self, stamp_ns: int, values: Array, regressors: Array) -> None:
        """One more scan of evidence; counts the scans in each direction of motion."""
        regressors[ELAPSED] = (stamp_ns - self.start_ns) / 1e9
        self.likelihood.add(values, regressors)
        self.scans += 1
        if np.isfinite(values[0]):
            self.out += bool(regressors[SPEED] > 0.0)
            self.back += bool(regressors[SPEED] < 0.0)
        self.moved += np.abs(regressors[MOTION]) > MOVING_M_S

    def conclusive(self) -> bool:
        """Whether likelihoods may drop: in one direction a drag and a bias look alike."""
        rubbing = any(residual.startswith("parity_mech") for residual, _, _ in self.symbols)
        if rubbing:
            return min(self.out, self.back) >= BOTH_WAYS_SAMPLES
        return self.scans >= CONCLUSIVE_SAMPLES


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
            for model in plant_models(fitted) + sensor_models(fitted)
            if any(term.residual in self._weighed for term in model.terms)
        )
        self._axes: tuple[str, ...] = ()
        self._bad: tuple[str, ...] = ()
        self._episodes = 0
        self._episode: _Episode | None = None
        self._levels: deque[VibrationLevel] = deque(maxlen=100)
        self._sentinel = Sentinel(knowledge.features.nominal)
        self._visited: deque[Quadrant | None] = deque(maxlen=400)
        self._moved_ns = NEVER_NS
        self._moved = 0
        self._mismatch = ""
        self._first_ns = NEVER_NS
        self._said: tuple[object, ...] = ()
        self._detected_ns = NEVER_NS

    def handle(self, record: Record) -> tuple[Record, ...]:
        """Records caused by one more input, once its turn in the merged order has come."""
        self._merge.push(record)
        return self._drain(everything=False)

    def finish(self) -> tuple[Record, ...]:
        """The input has ended: everything that still waits has its turn."""
        self._merge.hold(None)
        return self._drain(everything=True)

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
            self._axes = tuple(r.name for r in record.channels if r.name.startswith("accelero"))
            self._mismatch = _mismatch(self._k.calibration, record)
        return ()

    # --- what arrives -----------------------------------------------------------------

    def _data_quality(self, record: DataQuality) -> Iterable[Record]:
        unusable = (Quality.BAD, Quality.STALE, Quality.ABSENT)
        self._bad = tuple(row.channel for row in record.channels if row.quality in unusable)
        return self._say(record.stamp_ns)

    def _detection(self, record: Detection) -> Iterable[Record]:
        if record.detected and self._episode is None:
            # The symbols of the same scan come next, and make the first group.
            self._open(record.stamp_ns)
            return ()
        if not record.detected and self._episode is not None:
            self._episode = None
            self._merge.hold(None)
            return self._say(record.stamp_ns)
        return ()

    def _open(self, stamp_ns: int) -> _Episode:
        self._episodes += 1
        self._detected_ns = stamp_ns
        isolation = Isolation(self._k.faults, self._k.signatures)
        self._episode = _Episode(self._episodes, stamp_ns, isolation, Likelihood(self._weighed))
        return self._episode

    def _symbols(self, record: Symbols) -> Iterable[Record]:
        episode = self._episode
        if episode is None:
            return ()
        visited = {quadrant for quadrant in self._visited if quadrant is not None}
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
        if self._first_ns == NEVER_NS:
            self._first_ns = record.stamp_ns
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
        self._sentinel.motion(screw_rad_s, float(regressors[REGRESSORS.index("load_n")]))
        if moving:
            self._moved += 1
            self._moved_ns = stamp_ns
            known = math.isfinite(current)
            signs = (1 if current > 0 else -1, 1 if speed > 0 else -1)
            self._visited.append(Quadrant(*signs) if known else None)

    def _weigh(self, stamp_ns: int, episode: _Episode) -> Iterable[Record]:
        """Every half second of evidence: likelihoods, and whether the slow channels are done."""
        due = round((stamp_ns - episode.start_ns) / 500_000_000)
        if due == episode.weighed_at:
            return ()
        episode.weighed_at = due
        alive = {h.name for h in episode.isolation.alive()}
        models = [model for model in self._models if model.fault in alive]
        if models and episode.symbols and episode.scans:
            fits = episode.likelihood.fit(
                models, self._sigma, self._correlation, self._k.calibration.tolerances()
            )
            limit = self._p.drop_nats if episode.conclusive() else math.inf
            episode.isolation.weigh(stamp_ns, fits, limit)
        waited = (stamp_ns - episode.start_ns) / 1e9 >= self._p.settle_s
        if not episode.settled and (waited or episode.moving >= self._p.settle_samples):
            episode.settled = True
            moved = [c for c, n in zip(MOTION_CHANNELS, episode.moved) if n >= MOVED_SAMPLES]
            seen = {residual: magnitude for residual, magnitude, _ in episode.symbols}
            episode.isolation.require(stamp_ns, seen, moved)
        return [*self._say(stamp_ns), *self._ask(stamp_ns)]

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
                hypothesis.why_dropped = f"{axis} rose, and this fault does not show in vibration"
        episode.settled = True
        episode.isolation.share_out()
        return [*self._say(stamp_ns), *self._ask(stamp_ns)]

    # --- features ---------------------------------------------------------------------

    def _ask(self, stamp_ns: int) -> Iterable[Record]:
        """Request the next best feature, if one can split the group that is left."""
        episode = self._episode
        if episode is None or not episode.settled or episode.request or not self._axes:
            return ()
        group = {h.name: h.probability for h in episode.isolation.alive()}
        feature = self._chooser.next(group, episode.computed) if len(group) > 1 else None
        if feature is None:
            return ()
        episode.step += 1
        window_ns = round(self._p.feature_window_s * 1e9)
        episode.request = FeatureRequest(
            stamp_ns, episode.number, episode.step, feature, stamp_ns - window_ns, stamp_ns
        )
        self._merge.hold(stamp_ns + round(self._p.answer_budget_s * 1e9))
        return (episode.request,)

    def _feature(self, record: FeatureValue) -> Iterable[Record]:
        episode = self._episode
        asked = episode.request if episode is not None else None
        if episode is None or asked is None:
            return ()
        if (asked.episode, asked.step) != (record.episode, record.step):
            return ()
        episode.request = None
        self._merge.hold(None)
        episode.computed += (record.feature,)
        if record.symbol != "?":
            group = {h.name: h.probability for h in episode.isolation.alive()}
            left = refine(group, self._k.features, record.feature, record.symbol)
            episode.isolation.believe(record.stamp_ns, record.feature, record.symbol, left)
        return [*self._say(record.stamp_ns), *self._ask(record.stamp_ns)]

    # --- what is said -----------------------------------------------------------------

    def _say(self, stamp_ns: int) -> Sequence[Record]:
        """The ambiguity group, if it or its outcome has changed."""
        self._give_up(stamp_ns)
        outcome, words = self._outcome(stamp_ns)
        episode = self._episode
        alive = episode.isolation.alive() if episode is not None else []
        state = (outcome, episode.number if episode else 0, tuple(h.name for h in alive), self._bad)
        if state == self._said:
            return ()
        if episode is not None and self._said[:1] and self._said[1] == episode.number:
            episode.step += 1
        self._said = state
        return (self._group(stamp_ns, outcome, words, alive),)

    def _give_up(self, stamp_ns: int) -> None:
        """A feature whose answer never came is taken as not computable."""
        episode = self._episode
        if episode is None or episode.request is None:
            return
        if stamp_ns - episode.request.stamp_ns > self._p.answer_limit_s * 1e9:
            episode.computed += (episode.request.feature,)
            episode.request = None
            self._merge.hold(None)

    def _outcome(self, stamp_ns: int) -> tuple[Outcome, str]:
        if self._mismatch:
            return Outcome.MODEL_MISMATCH, self._mismatch
        outcome, words = self._episode_outcome(stamp_ns)
        from_the_start = self._detected_ns - self._first_ns <= EARLY_NS
        if outcome is Outcome.UNEXPLAINED and from_the_start:
            return (
                Outcome.MODEL_MISMATCH,
                f"{words}, and so from the start: the calibration does not fit this actuator",
            )
        return outcome, words

    def _episode_outcome(self, stamp_ns: int) -> tuple[Outcome, str]:
        episode = self._episode
        if episode is None:
            return self._quiet(stamp_ns)
        alive = episode.isolation.alive()
        names = ", ".join(h.name for h in alive)
        if not alive:
            return Outcome.UNEXPLAINED, "a deviation that no fault of the catalogue explains"
        if not episode.settled or episode.request is not None:
            return Outcome.DETECTED, f"a fault, one of: {names}"
        if self._unexplained(episode, alive):
            return Outcome.UNEXPLAINED, f"a deviation that none of {names} explains well"
        if len(alive) == 1:
            return Outcome.ISOLATED, f"the fault is {names}"
        return Outcome.INDISTINGUISHABLE, f"one of {names}: {self._why_not_split(alive)}"

    def _unexplained(self, episode: _Episode, alive: list[Hypothesis]) -> bool:
        """Relations deviate, every hypothesis has a model of them, and none gains on 'no fault'."""
        weighable = all(
            residual.removesuffix("_dn") in self._weighed for residual, _, _ in episode.symbols
        )
        if not weighable or any(h.fit is None for h in alive):
            return False
        return max(h.log_likelihood for h in alive) < self._p.explain_nats

    def _why_not_split(self, alive: list[Hypothesis]) -> str:
        if self._alike(alive) and not self._axes:
            return "cannot be split by this sensor set, by design; accelerometers would"
        if self._alike(alive):
            return "cannot be split by this sensor set, by design"
        return "not split by this evidence"

    def _alike(self, alive: list[Hypothesis]) -> bool:
        """Same quantitative model: no slow evidence can ever tell them apart."""
        terms = {_terms(self._models, h.name) for h in alive}
        return len(terms) == 1 and () not in terms

    def _quiet(self, stamp_ns: int) -> tuple[Outcome, str]:
        bad = [channel for channel in NEEDED if channel in self._bad]
        if bad:
            return Outcome.DATA_UNUSABLE, f"{', '.join(bad)} cannot be used"
        rested = self._moved_ns < 0 or stamp_ns - self._moved_ns > self._p.rest_s * 1e9
        if self._moved < 50 or rested:
            return (
                Outcome.NOT_OBSERVABLE,
                "the actuator does not move: faults of motor and screw show only in motion",
            )
        return Outcome.NOMINAL, "nothing deviates"

    def _group(
        self, stamp_ns: int, outcome: Outcome, words: str, alive: list[Hypothesis]
    ) -> AmbiguityGroup:
        episode = self._episode
        dropped = episode.isolation.dropped() if episode is not None else []
        suffix = " (single-fault assumption)" if episode is not None else ""
        return AmbiguityGroup(
            stamp_ns=stamp_ns,
            outcome=outcome,
            episode=episode.number if episode is not None else 0,
            step=episode.step if episode is not None else 0,
            seq=0,
            members=tuple(_candidate(h, self._models) for h in alive),
            dropped=tuple(_candidate(h, self._models) for h in dropped),
            detected_stamp_ns=self._detected_ns if episode is not None else NEVER_NS,
            words=words + suffix,
            calibration_sha256=self._k.calibration_sha256,
            source=self._p.source,
            not_observable=self._not_observable(),
            features_computed=episode.computed if episode is not None else (),
            features_available=len(self._k.features.features) if self._axes else 0,
        )

    def _not_observable(self) -> tuple[tuple[str, str], ...]:
        """Faults that this stand cannot show, with the reason."""
        if self._axes:
            return ()
        reason = "shows only in vibration, and this stand has no accelerometer"
        return tuple(
            (name, reason)
            for name, fault in self._k.faults.items()
            if fault.vibration and fault.approach == "data"
        )


def _mismatch(calibration: Calibration, table: ChannelTable) -> str:
    """What keeps a calibration from being used on a stand with this channel table, or ""."""
    here = {row.name for row in table.channels}
    missing = [name for name in calibration.channels if name not in here]
    if missing:
        return (
            f"the calibration is of a stand with {missing[0]}, this one has none: "
            "calibrate on recordings of this stand"
        )
    voltage = table.info("motor_voltage")
    if voltage is not None and voltage.sampling != calibration.voltage_sampling:
        return (
            f"the calibration is for a voltage sampled as {calibration.voltage_sampling!r}, this "
            f"stand samples {voltage.sampling!r}: calibrate on recordings of this stand"
        )
    return ""


def _terms(models: Sequence[FaultModel], fault: str) -> tuple[object, ...]:
    return tuple((model.sizes, model.terms) for model in models if model.fault == fault)


def _candidate(hypothesis: Hypothesis, models: Sequence[FaultModel]) -> Candidate:
    size, sigma, unit = math.nan, math.nan, ""
    if hypothesis.fit is not None:
        count = len(hypothesis.fit.sizes)
        model = next(m for m in models if m.fault == hypothesis.name and len(m.sizes) == count)
        size, sigma = hypothesis.fit.sizes[0], hypothesis.fit.sigmas[0]
        unit = model.sizes[0].unit
    return Candidate(
        hypothesis.name,
        hypothesis.deviation,
        hypothesis.probability if not hypothesis.why_dropped else 0.0,
        hypothesis.why_dropped or "fits everything seen so far",
        tuple(
            Evidence(f.stamp_ns, f.source, f.observed, f.predicted, f.words, f.path)
            for f in hypothesis.findings
        ),
        size,
        sigma,
        unit,
    )
