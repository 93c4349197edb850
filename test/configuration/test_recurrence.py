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

"""Which relations the watch for what comes and goes looks at, with which readings."""

from __future__ import annotations

import numpy as np

from flea_diag.configuration.evidence import evidence_of
from flea_diag.configuration.recurrence import recurrence_of
from flea_diag.configuration.stand import load_stand
from flea_diag.core.run_law.run_windows import signal_names


def test_no_relation_needs_what_only_a_dead_reading_would_act_by() -> None:
    """That a motor turns while its encoder is dead, the position says; else the circuit needs none.

    A dead reading does not come and go.
    """
    told = evidence_of(load_stand("ema"))
    known = recurrence_of(told)
    acting, names = known.hypotheses.acting, signal_names(told.told.effects)
    circuit = known.hypotheses.columns.relations.index("parity_electrical")
    every, asked = (acting(models)[circuit] for models in (True, known.usable))
    needed = {names[k] for k in np.flatnonzero(every & ~asked)}
    assert "d_actuator_position" in needed
    assert not asked[names.index("d_actuator_position")]
    assert asked[names.index("motor_speed")]
