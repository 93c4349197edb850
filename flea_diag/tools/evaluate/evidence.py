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
