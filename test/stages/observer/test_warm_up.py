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

"""Offsets of this unit, learned in the warm-up, and what a node loads before its own."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from support import stands
from support.observer_scans import after, decisions, healthy

from flea_diag.stages.observer.warm_up import WarmUp
from flea_diag.wire.records import Residual

S = 1_000_000_000


def test_an_offset_that_is_there_from_the_start_is_the_units_own():
    at = healthy()[0].channels.index("motor_current")
    other = [after(s, motor_current=s.values[at] + 0.25) for s in healthy()]
    out = stands.replay(stands.observer(), other)
    assert decisions(out) == []
    last = stands.of(Residual, out)[-1]
    current = last.regressors[last.regressor_names.index("motor_current")]
    plain = stands.of(Residual, stands.replay(stands.observer(), healthy()))[-1]
    assert current == pytest.approx(
        plain.regressors[plain.regressor_names.index("motor_current")], abs=0.02
    )
    # Without the warm-up nothing is learned.
    untaught = stands.of(Residual, stands.replay(stands.observer(warm_up_s=0.0), other))[-1]
    assert untaught.regressors[last.regressor_names.index("motor_current")] == pytest.approx(
        current + 0.25, abs=0.03
    )


def test_the_scan_that_ends_the_warm_up_comes_alone():
    warm_up = WarmUp(stands.relations().residuals, stands.calibration(), warm_up_s=6.0)
    warm_up.begin(S)
    stamps_ns = S * np.array([5, 6, 7, 8])
    assert warm_up.leading(stamps_ns) == 2  # the warm-up ends 7 s after zero
    assert warm_up.leading(stamps_ns[2:]) == 0
    assert warm_up.leading(stamps_ns[:2]) == 2


@pytest.mark.slow
def test_the_first_shift_seen_by_a_node_does_not_wait_for_imports() -> None:
    """Under load they took so long that the isolator called the source silent meanwhile."""
    code = (
        "import sys\n"
        "from flea_diag.configuration.component import OBSERVER\n"
        "assert 'scipy.special' not in sys.modules\n"
        "OBSERVER.warm_up(OBSERVER.parameters())\n"
        "assert 'scipy.special' in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
