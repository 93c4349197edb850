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

"""Tolerances of healthy units, as a description states them."""

from __future__ import annotations

import math

import pytest

from flea_diag.core.bond_graph.tolerance import Tolerance, free_per_run, tolerances
from flea_diag.errors import ConfigurationError

KNOWN = ("winding_resistance_ohm", "voltage_offset_v")


def test_a_share_is_of_the_value_and_a_number_is_an_amount() -> None:
    found = tolerances(
        {"winding_resistance_ohm": "2.5 %", "voltage_offset_v": 0.5}, KNOWN, "a.yaml"
    )
    assert found["winding_resistance_ohm"].of(-4.0) == pytest.approx(0.1)
    assert found["voltage_offset_v"].of(0.0) == 0.5
    assert Tolerance(share=0.1).of(0.0) > 0.0


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ({"lead": "5 %"}, "a.yaml: 'lead' is no base parameter, known are winding_resistance_ohm"),
        ({"voltage_offset_v": 0.0}, "a.yaml: voltage_offset_v = 0.0 must be a share"),
        ({"voltage_offset_v": "0 %"}, "voltage_offset_v = '0 %' must be a share"),
        ({"voltage_offset_v": "120 %"}, "must be a share from above 0 to 100"),
        ({"voltage_offset_v": "5 V"}, "voltage_offset_v = '5 V' must be a share"),
        ({"voltage_offset_v": float("nan")}, "must be a share"),
        ({"voltage_offset_v": True}, "must be a share"),
    ],
)
def test_what_is_no_tolerance_is_refused(content: dict[str, object], said: str) -> None:
    with pytest.raises(ConfigurationError, match=said):
        tolerances(content, KNOWN, "a.yaml")


VALUES = {"weight_n": 130.0, "upright_n_m": -4.0, "offset_n": 0.0}


def test_what_is_free_per_run_has_a_range_or_keeps_its_sign() -> None:
    assert free_per_run({"weight_n": [0.0, 300.0]}, VALUES, "a.yaml") == {"weight_n": (0.0, 300.0)}
    found = free_per_run(list(VALUES), VALUES, "a.yaml")
    assert found == {
        "weight_n": (0.0, math.inf),
        "upright_n_m": (-math.inf, 0.0),
        "offset_n": (-math.inf, math.inf),
    }


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (["lead"], "a.yaml: 'lead' is no base parameter, known are weight_n"),
        ({"weight_n": [300.0, 0.0]}, r"weight_n = \[300, 0\] must be a range, the lower end first"),
        ({"weight_n": [0.0, 100.0]}, "weight_n of this description is 130, outside of its range 0"),
        ({"weight_n": [0.0]}, "weight_n"),
        ({"weight_n": "heavy"}, "weight_n"),
    ],
)
def test_a_range_that_is_none_is_refused(content: object, said: str) -> None:
    with pytest.raises(ConfigurationError, match=said) as refusal:
        free_per_run(content, VALUES, "a.yaml")
    assert "\n" not in str(refusal.value)
