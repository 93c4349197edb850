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

"""Stages built from parameters: a component for each node, and the pipeline of a replay."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, fields, make_dataclass, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from flea_diag.configuration.calibrations import calibration_sha256, law_of, learned
from flea_diag.configuration.knowledge import effects, knowledge, load_features
from flea_diag.configuration.stand import Stand
from flea_diag.configuration.stand_parameters import StandParameters, stand_of
from flea_diag.core.backend import compiling
from flea_diag.core.evidence.marginal_ratio import try_out_share
from flea_diag.core.vibration.block_moments import try_out_moments
from flea_diag.core.vibration.features import try_out
from flea_diag.errors import ConfigurationError
from flea_diag.stages import Stage
from flea_diag.stages.extractor.extractor import ExtractorParameters, ExtractorStage
from flea_diag.stages.isolator.isolator import IsolatorParameters, IsolatorStage, Knowledge
from flea_diag.stages.observer.observer import ObserverStage
from flea_diag.stages.observer.observer_parameters import ObserverParameters
from flea_diag.stages.observer.state_estimate import NONE
from flea_diag.stages.pipeline import Pipeline
from flea_diag.stages.sizes.size_watch import SizeWatch
from flea_diag.wire.parameters import parameter
from flea_diag.wire.records import Scan, VibrationBlock

if TYPE_CHECKING:
    from flea_diag.configuration.evidence import EvidenceStand

WARM_UP_SCANS = 60
"""Number of scans of the warm-up, more than the delay of the smoothing."""


@dataclass(frozen=True)
class Memory:
    """State file from which a restarted isolator or diagnoser resumes."""

    memory: str = parameter(
        "",
        "file that stores the verdict for a restart during a run; empty: one per domain and node "
        "below the user's state folder; none: no file",
        read_only=True,
    )


@dataclass(frozen=True)
class Batch:
    """How scans are taken together."""

    batch_ms: int = parameter(
        0,
        "time for which scans are collected and then judged at once: same decisions for less CPU, "
        "later by up to this; 0: each on arrival; 20 to 100 for many stands on one machine",
        unit="ms",
        minimum=0,
        maximum=100,
        read_only=True,
    )


@dataclass(frozen=True)
class DataSource:
    """Whether the data is that of the stand now."""

    source: str = parameter(
        "live",
        "source of the data; of a replay nothing is raised on /diagnostics",
        choices=("live", "replay"),
        read_only=True,
    )


HYBRID, EVIDENCE = "hybrid", "evidence"


@dataclass(frozen=True)
class Decides:
    """What decides."""

    configuration: str = parameter(
        HYBRID,
        "what detects and isolates, the same for observer and isolator: signs and likelihoods "
        "after tests of every residual, or the evidence by the law of healthy recordings",
        choices=(HYBRID, EVIDENCE),
        read_only=True,
    )


P = TypeVar("P")


def _joined(name: str, parts: tuple[type, ...]) -> type:
    """One parameter class with the fields of several; of two of a name it takes the first."""
    entries: dict[str, Any] = {}
    for entry in (entry for part in parts for entry in fields(part)):
        entries.setdefault(entry.name, entry)
    own = [(key, entry.type, _copied(entry)) for key, entry in entries.items()]
    return make_dataclass(name, own, frozen=True)


def _copied(entry: Any) -> Any:
    return parameter(entry.default, **entry.metadata)


def _part(kind: type[P], values: Any) -> P:
    names = {entry.name for entry in fields(kind)}  # type: ignore[arg-type]
    given: Mapping[str, Any] = {k: v for k, v in asdict(values).items() if k in names}
    return kind(**given)


def _unheard(_name: str) -> None:
    """Nobody asked for the progress."""


@dataclass(frozen=True)
class Component(Generic[P]):
    """Builds a stage from one frozen parameter object, whose class joins several."""

    name: str
    parts: tuple[type, ...]
    make: Callable[[Stand, Any], Stage]

    @cached_property
    def parameters(self) -> type:
        """Class of the parameters; made when it is first asked for, as few programs need all."""
        return _joined(self.name, self.parts)

    def build(self, parameters: Any) -> Stage:
        """Fresh stage with these parameters."""
        return self.make(stand_of(parameters), parameters)

    def described(self, parameters: Any) -> str:
        """Which files, by name and content, a stage of these parameters rests on."""
        stand = stand_of(parameters)
        calibration = learned(stand)
        return (
            f"stand {stand.name} ({stand.folder}), calibration {stand.calibration} of actuator "
            f"{calibration.actuator} (sha256 {calibration_sha256(calibration)[:12]})"
        )

    def check(self, parameters: Any) -> None:
        """Refuse files from which no stage can be built; quick, for it builds none.

        Raises
        ------
        FleaError
            Names the file or parameter, its value and the remedy.
        """
        stand = stand_of(parameters)
        effects(stand, learned(stand))
        load_features(stand.features)
        if getattr(parameters, "configuration", HYBRID) == EVIDENCE:
            law_of(stand)

    def warm_up(self, parameters: Any, begun: Callable[[str], None] = _unheard) -> None:
        """Run scans and features through a throw-away stage, to compile and load its code.

        ``begun`` is called with the name of each function whose compilation begins.

        Otherwise the first scan is delayed by this, by up to a minute if nothing is compiled yet,
        later scans are lost, and the first answer to a feature request is late.
        """
        with compiling(begun):
            self._warmed(parameters)

    def _warmed(self, parameters: Any) -> None:
        stand = stand_of(parameters)
        stage = self.make(stand, parameters)
        if Scan not in stage.consumes:
            return
        if VibrationBlock in stage.consumes:
            table = load_features(stand.features)
            try_out(table.features, table.nominal.rate_hz)
            try_out_moments()
        calibration = learned(stand)
        if calibration.law is not None:
            try_out_share()
        channels, period_ns = calibration.channels, round(calibration.period_s * 1e9)
        for number in range(WARM_UP_SCANS):
            values = tuple(1e-3 * number * column for column in range(1, len(channels) + 1))
            stage.handle(Scan((1 + number) * period_ns, channels, values))


def _observer(stand: Stand, values: Any) -> ObserverStage:
    parameters = _part(ObserverParameters, values)
    if values.configuration == EVIDENCE:
        return _by_evidence(stand).observer(parameters)
    calibration = learned(stand)
    known = effects(stand, calibration)
    nominal = load_features(stand.features).nominal
    if calibration.law is None:
        return ObserverStage(calibration, known, parameters, nominal)
    from flea_diag.stages.evidence.unit_chain import UnitChain

    chain = UnitChain(_by_evidence(stand).knowledge, calibration, known, parameters)
    return ObserverStage(calibration, known, parameters, nominal, chain)


def _isolator(stand: Stand, values: Any, in_process: bool = False) -> IsolatorStage:
    parameters = _part(IsolatorParameters, values)
    if values.configuration == EVIDENCE:
        return _by_evidence(stand).isolator(parameters, in_process)
    told = _knowledge(stand)
    if told.calibration.law is not None:
        from flea_diag.configuration.recurrence import recurrence_of

        told = replace(told, recurrence=recurrence_of(_by_evidence(stand)))
    return IsolatorStage(told, parameters, in_process)


def _sized_isolator(stand: Stand, values: Any) -> Pipeline:
    """The isolator, and what follows the size of what it names."""
    return Pipeline((_isolator(stand, values), _sizes(stand)))


def _sizes(stand: Stand) -> SizeWatch:
    return SizeWatch(_knowledge(stand))


def _knowledge(stand: Stand) -> Knowledge:
    """What the stages of a stand know; with a law that of the evidence, which is made once."""
    calibration = learned(stand)
    if calibration.law is None:
        return knowledge(stand, calibration)
    return _by_evidence(stand).told


def _by_evidence(stand: Stand) -> EvidenceStand:
    """Made once for all stages of one stand in a process, and again when a file of it changes."""
    from flea_diag.configuration.evidence import evidence_of

    try:
        texts = tuple(stand.texts().values())
    except ConfigurationError:
        return evidence_of(stand)  # it says what is missing, and how to make it
    return _made(stand, texts)


@lru_cache(maxsize=32)
def _made(stand: Stand, texts: tuple[str, ...]) -> EvidenceStand:
    """Of a stand with these texts in its files; of so many stands of a fleet."""
    from flea_diag.configuration.evidence import evidence_of

    return evidence_of(stand)


def _extractor(stand: Stand, values: Any) -> ExtractorStage:
    import time

    return ExtractorStage(
        load_features(stand.features), _part(ExtractorParameters, values), time.perf_counter_ns
    )


def _diagnoser(stand: Stand, values: Any) -> Pipeline:
    isolator = _isolator(stand, values, in_process=True)
    return Pipeline((_observer(stand, values), isolator, _extractor(stand, values), _sizes(stand)))


def evidence_pipeline(known: EvidenceStand, stand: Stand, **given: Any) -> Pipeline:
    """The three stages by an evidence that is made, for a replay without ROS."""
    values = DIAGNOSER.parameters(source="replay", configuration=EVIDENCE, **given)
    observer = known.observer(_part(ObserverParameters, values))
    isolator = known.isolator(_part(IsolatorParameters, values), in_process=True)
    return Pipeline((observer, isolator, _extractor(stand, values)))


OBSERVER: Component[Any] = Component(
    "Observer", (StandParameters, DataSource, Decides, Batch, ObserverParameters), _observer
)
ISOLATOR: Component[Any] = Component(
    "Isolator", (StandParameters, Decides, Memory, IsolatorParameters), _sized_isolator
)
EXTRACTOR: Component[Any] = Component(
    "Extractor", (StandParameters, DataSource, ExtractorParameters), _extractor
)
DIAGNOSER: Component[Any] = Component(
    "Diagnoser",
    (
        StandParameters,
        Decides,
        Memory,
        Batch,
        ObserverParameters,
        IsolatorParameters,
        ExtractorParameters,
    ),
    _diagnoser,
)


def make_observer(stand: Stand) -> Pipeline:
    """The observer alone, for a replay that takes residuals and no verdict.

    It learns nothing of the unit at the start: a fault that is there already would be learned.
    """
    values = OBSERVER.parameters(source="replay", warm_up_s=0.0, state_observer=NONE)
    return Pipeline((_observer(stand, values),))


def make_pipeline(stand: Stand, source: str = "replay", **given: Any) -> Pipeline:
    """The three stages as a pipeline, for a replay without ROS; ``given`` are their parameters."""
    values = DIAGNOSER.parameters(source=source, **given)
    return _diagnoser(stand, values)
