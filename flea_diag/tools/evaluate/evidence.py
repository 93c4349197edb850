"""The diagnosis by one evidence, by a law that is learned from nominal bags where there is none."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from flea_diag.configuration.calibrations import learned
from flea_diag.configuration.description import compiled_relations
from flea_diag.configuration.evidence import EvidenceStand, evidence_of
from flea_diag.configuration.stand import Stand
from flea_diag.core.run_law.run_law import RunLaw
from flea_diag.tools.calibrate.law import LawOfRecordings
from flea_diag.tools.calibrate.nominal_recording import read_nominal
from flea_diag.tools.calibrate.shared_work import ALONE


@cache
def evidence_stand(stand: Stand, nominal: tuple[Path, ...] = ()) -> EvidenceStand:
    """The diagnosis of a stand, by the law of its calibration or by one of these recordings.

    Raises
    ------
    ConfigurationError
        The calibration has no law, and there are no recordings to learn one from.
    """
    own = learned(stand).law
    return evidence_of(stand, own or _law_of(stand, nominal))


def _law_of(stand: Stand, nominal: tuple[Path, ...]) -> RunLaw | None:
    if not nominal:
        return None
    calibration = learned(stand)
    known = compiled_relations(stand.actuator).residuals
    recordings, _ = read_nominal(list(nominal), known)
    found = LawOfRecordings.of(calibration, stand.actuator, stand.faults, recordings, ALONE)
    return found.seeing(calibration, recordings, ALONE)
