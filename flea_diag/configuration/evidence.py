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

from dataclasses import dataclass

from flea_diag.configuration.calibrations import learned
from flea_diag.configuration.description import described
from flea_diag.configuration.knowledge import effects, knowledge
from flea_diag.configuration.stand import Stand
from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.evidence.friction import Friction
from flea_diag.core.evidence.hypotheses import StreamHypotheses, signatures_of
from flea_diag.core.isolation.detectability import shows_from
from flea_diag.core.likelihood.effect_set import EffectSet, motion_signals
from flea_diag.core.residuals.measured_graph import rate_symbol
from flea_diag.core.residuals.parameters import ActuatorParameters
from flea_diag.core.residuals.residual_rows import ResidualSet
from flea_diag.core.run_law.law_columns import dry_friction, law_columns
from flea_diag.core.run_law.run_law import RunLaw
from flea_diag.core.run_law.run_windows import WINDOW_S, signal_names, speed_signal
from flea_diag.core.run_law.visible_sizes import ONSETS_PER_HOUR
from flea_diag.errors import ConfigurationError
from flea_diag.stages.evidence.evidence_stage import EvidenceKnowledge, EvidenceStage
from flea_diag.stages.evidence.evidence_verdict import VerdictKnowledge
from flea_diag.stages.evidence.residual_source import ResidualSource
from flea_diag.stages.evidence.sensor_modes import ChannelMotion, SensorKnowledge, SensorModes
from flea_diag.stages.evidence.stream_columns import StreamColumns
from flea_diag.stages.evidence.stream_evidence import limits_of
from flea_diag.stages.isolator.parameters import Knowledge
from flea_diag.stages.observer.regressor_table import answers_of
from flea_diag.stages.pipeline import Pipeline


@dataclass(frozen=True)
class EvidenceStand:
    """What the stage of a stand is made of."""

    calibration: Calibration
    effects: EffectSet
    sensors: SensorKnowledge
    law: RunLaw
    knowledge: EvidenceKnowledge

    def stage(self) -> Pipeline:
        """A new diagnoser."""
        return Pipeline((self.source(), self.judge()))

    def source(self) -> ResidualSource:
        """Scans in, residuals out."""
        known, calibration = self.effects, self.calibration
        answers = answers_of(known, calibration.parameters, self.law.relations)
        return ResidualSource(calibration, known, answers)

    def judge(self) -> EvidenceStage:
        """Residuals in, verdicts out."""
        known, calibration = self.effects, self.calibration
        rows = known.residuals
        scans = max(1, round(WINDOW_S / calibration.period_s))
        current, load, way, *speeds = motion_signals(rows)
        moving = current, load, way, speed_signal(rows)
        motions = _motions(rows, calibration.parameters).values()
        slow = {motion.signal: motion.slow for motion in motions if motion.signal in speeds}
        known_by = self.knowledge.hypotheses[0]
        columns = StreamColumns(
            self.law.relations, frozenset(rows.in_motion), signal_names(known),
            moving, known_by.acting, slow, known.relations.stop,
            self.law.travel, calibration.period_s, scans,
        )  # fmt: skip
        return EvidenceStage(self.knowledge, columns, self.sensors)


def with_law(stand: Stand, calibration: Calibration, law: RunLaw) -> EvidenceStand:
    """The diagnosis by a law."""
    known = effects(stand, calibration)
    parameters, names = calibration.parameters, signal_names(known)
    tolerance = dict(
        zip(known.differences, calibration.differences(known.differences), strict=True)
    )
    free = described(str(stand.actuator)).free_per_run
    every = law_columns(known, parameters, tolerance, law.relations, free)
    columns = every.some([every.names.index(term.name) for term in law.terms])
    order = [columns.names.index(term.name) for term in law.terms]
    assert order == sorted(order)
    dry = dry_friction(known, parameters, law.relations)
    friction = Friction(dry, names.index(speed_signal(known.residuals)), law.usual_speed)
    signatures = signatures_of(known.bound(parameters), names, law)
    rooms = [name for name in known.residuals.predictions if name in known.residuals.own]
    made = tuple(
        StreamHypotheses.of(law, columns, signatures, friction, another, rooms)
        for another in (False, True)
    )
    told = knowledge(stand, calibration)
    sensors = _sensors(told)
    judged = {model.fault for model in signatures.models} - SensorModes(sensors).faults
    limits = limits_of(len(judged), calibration.false_alarms_per_hour, ONSETS_PER_HOUR)
    verdict = VerdictKnowledge(
        signatures.models, law.relations, told.faults, told.calibration_sha256,
        calibration.promise.stated_per_hour, calibration.promise.supported_per_hour,
        shows_from(law.visible),
    )  # fmt: skip
    judged_by = EvidenceKnowledge((made[0], made[1]), frozenset(judged), limits, verdict)
    return EvidenceStand(calibration, known, sensors, law, judged_by)


def _sensors(told: Knowledge) -> SensorKnowledge:
    """What tests of single sensors say: those of the diagnosis, and when a reading moves."""
    calibration, rows, names = told.calibration, told.effects.residuals, told.effects.names
    speeds = _motions(rows, calibration.parameters)
    motion = {channel: speed for channel, speed in speeds.items() if speed.signal in names}
    tests = frozenset(row.name for row in rows.sensor_rows)
    unseen = told.symptoms.death_unseen
    return SensorKnowledge(tests, told.faults, motion, unseen, calibration.period_s)


def _motions(rows: ResidualSet, parameters: ActuatorParameters) -> dict[str, ChannelMotion]:
    """When the reading of each channel of motion moves."""
    slow, per_rad = parameters.moving_m_s, parameters.encoder_m_per_rad
    motions = {name: ChannelMotion(rate_symbol(name), slow) for name in rows.positions}
    if per_rad:
        motions[rows.encoder] = ChannelMotion(rows.encoder, slow / per_rad)
    return motions


def evidence_of(stand: Stand, law: RunLaw | None = None) -> EvidenceStand:
    """The diagnosis of a stand by the law of its calibration, or by another one.

    Raises
    ------
    ConfigurationError
        The calibration has no law, and none is given.
    """
    calibration = learned(stand)
    law = calibration.law or law
    if law is None:
        raise ConfigurationError(
            f"{stand.calibration} holds no law of healthy recordings: make it again by "
            "`flea calibrate`, or name nominal bags under `learn_from` in a campaign"
        )
    return with_law(stand, calibration, law)
