"""The diagnosis by one evidence, of a stand and a law of healthy recordings."""

from __future__ import annotations

from dataclasses import dataclass

from flea_diag.configuration.calibrations import learned
from flea_diag.configuration.description import described
from flea_diag.configuration.knowledge import effects, knowledge
from flea_diag.configuration.stand import Stand
from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.evidence.hypotheses import StreamHypotheses, signatures_of
from flea_diag.core.faults.fault import Fault
from flea_diag.core.likelihood.effect_set import EffectSet, motion_signals
from flea_diag.core.run_law.law_columns import law_columns
from flea_diag.core.run_law.run_law import RunLaw
from flea_diag.core.run_law.run_windows import WINDOW_S, signal_names
from flea_diag.core.run_law.visible_sizes import ONSETS_PER_HOUR
from flea_diag.errors import ConfigurationError
from flea_diag.stages.baselines.sensor_alarms import SensorAlarms
from flea_diag.stages.evidence.evidence_stage import EvidenceKnowledge, EvidenceStage
from flea_diag.stages.evidence.residual_source import ResidualSource
from flea_diag.stages.evidence.stream_columns import StreamColumns
from flea_diag.stages.evidence.stream_evidence import limits_of
from flea_diag.stages.observer.regressor_table import answers_of
from flea_diag.stages.pipeline import Pipeline


@dataclass(frozen=True)
class EvidenceStand:
    """What the stage of a stand is made of."""

    calibration: Calibration
    effects: EffectSet
    faults: dict[str, Fault]
    law: RunLaw
    knowledge: EvidenceKnowledge

    def stage(self) -> Pipeline:
        """A new diagnoser."""
        known, calibration = self.effects, self.calibration
        rows = known.residuals
        answers = answers_of(known, calibration.parameters, self.law.relations)
        scans = max(1, round(WINDOW_S / calibration.period_s))
        current, load, way = motion_signals(rows)[:3]
        columns = StreamColumns(
            self.law.relations, frozenset(rows.in_motion), signal_names(known),
            (current, load, way), calibration.period_s, scans,
        )  # fmt: skip
        alarms = SensorAlarms([row.name for row in rows.sensor_rows], self.faults)
        judge = EvidenceStage(self.knowledge, columns, alarms)
        return Pipeline((ResidualSource(calibration, known, answers), judge))


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
    signatures = signatures_of(known.bound(parameters), names, law)
    faults = knowledge(stand, calibration).faults
    made = tuple(
        StreamHypotheses.of(law, columns, signatures, another) for another in (False, True)
    )
    limits = limits_of(
        len({model.fault for model in signatures.models}),
        calibration.false_alarms_per_hour,
        ONSETS_PER_HOUR,
    )
    return EvidenceStand(
        calibration, known, dict(faults), law, EvidenceKnowledge((made[0], made[1]), limits)
    )


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
