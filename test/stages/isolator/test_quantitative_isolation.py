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

"""What quantitative isolation takes as evidence of which relation."""

from __future__ import annotations

import pytest
from support import stands
from support.stand_runs import last_verdict

from flea_diag.core.likelihood.sensor_models import expected
from flea_diag.stages.isolator.quantitative_isolation import QuantitativeIsolation

RUN_AWAY = {
    "duration_s": 28.0,
    "machine": "wing",
    "seed": 136277492,
    "unit_seed": 343,
    "ambient_degc": 23.9,
    "warm_degc": 6.9,
    "motion": {"amplitude_m": 0.0194, "frequency_hz": 0.213, "centre_m": 0.0439},
    "load": {"constant_n": 2420.2},
    "faults": [{"fault": "winding_open", "onset_s": 19.38}],
}
"""A load that turns an open motor, faster than was calibrated, until a stop holds it."""


def test_a_prediction_is_evidence_without_the_reading_of_its_surroundings() -> None:
    known = stands.knowledge()
    found = QuantitativeIsolation(known.calibration, known.effects)
    ambient = found.basis.column[expected("ambient_temperature").name]
    acting = dict(zip(found.names, found.acting[:, ambient].tolist(), strict=True))
    assert acting["ambient_temperature"]
    assert not acting["motor_temperature"]
    assert not acting["nut_temperature"]


@pytest.mark.slow
def test_nothing_is_dropped_until_a_relation_that_deviates_is_weighed() -> None:
    """The circuit deviates at once, and cannot be weighed before the stop."""
    last = last_verdict("wing", **RUN_AWAY)
    assert stands.members(last) == {"winding_open", "motor_failure"}
