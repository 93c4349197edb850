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

"""The diagnosis by one evidence, of a stand and a law of healthy recordings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from flea_diag.configuration.calibrations import law_of, learned
from flea_diag.configuration.description import described
from flea_diag.configuration.knowledge import effects, knowledge
from flea_diag.configuration.stand import Stand
from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.evidence.friction import Friction
from flea_diag.core.evidence.hypotheses import StreamHypotheses, signatures_of
from flea_diag.core.evidence.turned_way import TurnedWay
from flea_diag.core.isolation.predicted_symbols import steps
from flea_diag.core.likelihood.effect_set import EffectSet, motion_signals
from flea_diag.core.residuals.measured_graph import rate_symbol
from flea_diag.core.residuals.parameters import ActuatorParameters
from flea_diag.core.residuals.residual_rows import ResidualSet
from flea_diag.core.run_law.law_columns import dry_friction, law_columns
from flea_diag.core.run_law.run_law import RunLaw
from flea_diag.core.run_law.run_windows import (
    current_side,
    signal_names,
    speed_signal,
    window_scans,
)
from flea_diag.core.run_law.visible_sizes import ONSETS_PER_HOUR
from flea_diag.stages.evidence.evidence_chain import EvidenceChain
from flea_diag.stages.evidence.evidence_detection import EvidenceKnowledge
from flea_diag.stages.evidence.evidence_method import EvidenceMethod
from flea_diag.stages.evidence.sensor_modes import ChannelMotion, SensorKnowledge, SensorModes
from flea_diag.stages.evidence.stream_columns import StreamColumns
from flea_diag.stages.evidence.stream_evidence import limits_of
from flea_diag.stages.isolator.isolator import IsolatorStage
from flea_diag.stages.isolator.parameters import IsolatorParameters, Knowledge
from flea_diag.stages.observer.observer import ObserverStage
from flea_diag.stages.observer.observer_parameters import ObserverParameters


@dataclass(frozen=True)
class EvidenceStand:
    """What the stages of a stand are made of."""

    told: Knowledge
    knowledge: EvidenceKnowledge

    @property
    def calibration(self) -> Calibration:
        """The one that everything rests on."""
        return self.told.calibration

    def observer(self, parameters: ObserverParameters) -> ObserverStage:
        """Scans in, residuals and detection out."""
        known, calibration = self.told.effects, self.calibration
        chain = EvidenceChain(self.knowledge, calibration, known, parameters)
        return ObserverStage(calibration, known, parameters, self.told.features.nominal, chain)

    def isolator(self, parameters: IsolatorParameters, in_process: bool = False) -> IsolatorStage:
        """Residuals and detection in, verdicts out."""
        method = partial(EvidenceMethod, self.knowledge)
        return IsolatorStage(self.told, parameters, in_process, method)


def with_law(stand: Stand, calibration: Calibration, law: RunLaw) -> EvidenceStand:
    """The diagnosis by a law."""
    known = effects(stand, calibration)
    made = stream_hypotheses(stand, calibration, known, law)
    told = knowledge(stand, calibration)
    sensors = _sensors(told)
    judged = {model.fault for model in made[0].signatures.models} - SensorModes(sensors).faults
    limits = limits_of(len(judged), calibration.false_alarms_per_hour, ONSETS_PER_HOUR)
    judged_by = EvidenceKnowledge(
        made, law.relations, frozenset(judged), limits, sensors, law.visible,
        stream_columns(known, calibration, law, made[0]),
        window_scans(calibration.period_s),
    )  # fmt: skip
    return EvidenceStand(told, judged_by)


def stream_hypotheses(
    stand: Stand, calibration: Calibration, known: EffectSet, law: RunLaw
) -> tuple[StreamHypotheses, StreamHypotheses]:
    """Of the unit of a calibration, and of another one."""
    parameters, names = calibration.parameters, signal_names(known)
    tolerance = dict(
        zip(known.differences, calibration.differences(known.differences), strict=True)
    )
    free = described(str(stand.actuator)).free_per_run
    every = law_columns(known, parameters, tolerance, law.relations, free)
    columns = every.some([every.names.index(term.name) for term in law.terms])
    dry = dry_friction(known, parameters, law.relations)
    friction = Friction.of(dry, known, law.usual_speed)
    way = TurnedWay.of(known, parameters, law.relations)
    models, signed = known.bound(parameters), way.channel if way else ""
    signatures = signatures_of(models, names, law, signed)
    rooms = [name for name in known.residuals.predictions if name in known.residuals.own]
    recording_s = calibration.nominal_s / law.recordings
    own, another = (
        StreamHypotheses.of(law, columns, signatures, friction, other, rooms, recording_s, way)
        for other in (False, True)
    )
    return own, another


def stream_columns(
    known: EffectSet, calibration: Calibration, law: RunLaw, known_by: StreamHypotheses
) -> Callable[[], StreamColumns]:
    """What makes the windows of a stream."""
    rows = known.residuals
    current, load, way, *speeds = motion_signals(rows)
    moving = current, load, way, speed_signal(rows)
    motions = _motions(rows, calibration.parameters).values()
    slow = {motion.signal: motion.slow for motion in motions if motion.signal in speeds}
    return partial(
        StreamColumns, law.relations, frozenset(rows.in_motion), signal_names(known), moving,
        slow, known.relations.stop, law.travel, calibration.period_s,
        window_scans(calibration.period_s), current_side(known), acting=known_by.acting(),
    )  # fmt: skip


def _sensors(told: Knowledge) -> SensorKnowledge:
    """What tests of single sensors say: those of the diagnosis, and when a reading moves."""
    calibration, rows, names = told.calibration, told.effects.residuals, told.effects.names
    speeds = _motions(rows, calibration.parameters)
    motion = {channel: speed for channel, speed in speeds.items() if speed.signal in names}
    tests = frozenset(row.name for row in rows.sensor_rows)
    unseen = (*told.symptoms.death_unseen, *told.symptoms.death_s)
    tables = told.signatures.values()
    stepping = frozenset(
        name
        for name, fault in told.faults.items()
        if any(True for table in tables for _ in steps(fault, table, told.symptoms))
    )
    return SensorKnowledge(tests, told.faults, motion, unseen, calibration.period_s, stepping)


def _motions(rows: ResidualSet, parameters: ActuatorParameters) -> dict[str, ChannelMotion]:
    """When the reading of each channel of motion moves."""
    slow, per_rad = parameters.moving_m_s, parameters.encoder_m_per_rad
    motions = {name: ChannelMotion(rate_symbol(name), slow) for name in rows.positions}
    if per_rad:
        motions[rows.encoder] = ChannelMotion(rows.encoder, slow / per_rad)
    return motions


def evidence_of(stand: Stand, law: RunLaw | None = None) -> EvidenceStand:
    """The diagnosis of a stand by a law, or by that of its calibration.

    Raises
    ------
    ConfigurationError
        The calibration has no law, and none is given.
    """
    return with_law(stand, learned(stand), law or law_of(stand))
