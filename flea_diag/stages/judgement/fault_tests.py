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

"""Which tests of a calibrated stand would show each fault of its catalogue."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.faults.fault import Fault
from flea_diag.core.isolation.detectability import smallest_detectable_offsets
from flea_diag.core.isolation.predicted_symbols import JUMP_MODES, OWN_TESTS
from flea_diag.core.likelihood.fault_models import FaultModel, moved_by
from flea_diag.core.residuals.residual_rows import ResidualSet
from flea_diag.stages.judgement.tested import tested_names


def tests_of_faults(
    faults: Mapping[str, Fault],
    models: Sequence[FaultModel],
    calibration: Calibration,
    known: ResidualSet,
) -> dict[str, frozenset[str]]:
    """Relations, predictions and tests of single sensors that a fault moves; none: left out.

    What the state observer tests is not among them: it detects, and names nothing.
    """
    relations = {known.relation(name) for name in smallest_detectable_offsets(calibration)}
    alone = set(tested_names(known, calibration)) & {row.name for row in known.sensor_rows}
    found = {
        name: moved_by(m for m in models if m.fault == name) & relations | _own(fault) & alone
        for name, fault in faults.items()
    }
    return {name: tests for name, tests in found.items() if tests}


def _own(fault: Fault) -> set[str]:
    """Names of the tests of its sensor alone that a fault moves, where the stand has them."""
    if not fault.channel:
        return set()
    steps = {fault.channel} if fault.mode in JUMP_MODES else set()
    return steps | {
        f"{fault.channel}_{test}" for test, modes in OWN_TESTS.items() if fault.mode in modes
    }
