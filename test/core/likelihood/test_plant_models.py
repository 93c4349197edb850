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

"""What a fault of the plant does beside its effects on the balances: it heats."""

from __future__ import annotations

from functools import cache

import pytest

from flea_diag.configuration.calibrations import learned
from flea_diag.configuration.knowledge import knowledge
from flea_diag.configuration.stand import load_stand
from flea_diag.core.likelihood.plant_models import supplied
from flea_diag.stages.isolator.parameters import Knowledge


@cache
def known(machine: str) -> Knowledge:
    stand = load_stand(machine)
    return knowledge(stand, learned(stand))


@pytest.mark.parametrize(
    ("fault", "heats"),
    [
        ("jam", {"nut_temperature"}),
        ("winding_resistance_rise", {"motor_temperature"}),
        ("magnet_loss", set()),
        ("nut_temperature_bias", set()),
    ],
)
def test_a_fault_heats_what_its_parameter_supplies(fault: str, heats: set[str]) -> None:
    ema = known("ema")
    assert supplied(ema.faults[fault], ema.effects.relations) == heats
    if not ema.faults[fault].channel:
        assert {"motor_temperature", "nut_temperature"} & ema.moved[fault] == heats


def test_a_relation_is_void_without_the_readings_that_its_faults_act_by() -> None:
    effects = known("flea").effects
    assert effects.needing("motor_speed") >= {"parity_electrical", "parity_mechanical"}
    assert "parity_drive" not in effects.needing("motor_speed")
    assert effects.needing("ambient_temperature") == {"ambient_temperature"}
