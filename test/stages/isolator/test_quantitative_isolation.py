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

from support import stands

from flea_diag.core.likelihood.sensor_models import expected
from flea_diag.stages.isolator.quantitative_isolation import QuantitativeIsolation


def test_a_prediction_is_evidence_without_the_reading_of_its_surroundings() -> None:
    known = stands.knowledge()
    found = QuantitativeIsolation(known.calibration, known.effects)
    ambient = found.basis.column[expected("ambient_temperature").name]
    acting = dict(zip(found.names, found.acting[:, ambient].tolist(), strict=True))
    assert acting["ambient_temperature"]
    assert not acting["motor_temperature"]
    assert not acting["nut_temperature"]
