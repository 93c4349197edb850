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

"""Travel of the moved part: read from the description, refused by name, value and remedy."""

from __future__ import annotations

import copy
from typing import Any

import pytest

from flea_diag.configuration.files import load_yaml
from flea_diag.core.bond_graph.actuator import actuator
from flea_diag.core.bond_graph.travel import Travel
from flea_diag.errors import ConfigurationError


def described(**travel: Any) -> Any:
    content = copy.deepcopy(load_yaml("actuator.yaml"))
    content["travel"] = travel
    return actuator(content, sound=False)


def test_the_ends_are_those_of_the_description() -> None:
    assert described(at="nut", low_m=0.01, high_m=0.07, within_m=0.003).travel == Travel(
        "nut", 0.01, 0.07, 0.003
    )


def test_two_hundredths_of_the_travel_are_its_end_by_default() -> None:
    travel = described(at="nut", low_m=0.0, high_m=0.25).travel
    assert travel is not None
    assert travel.within_m == pytest.approx(0.005)


def test_a_description_may_lack_it() -> None:
    assert described().travel is None


@pytest.mark.parametrize(
    ("travel", "words"),
    [
        ({"at": "nut", "low_m": 0.1, "high_m": 0.1}, ("low_m", "0.1", "below high_m")),
        ({"at": "mast", "low_m": 0.0, "high_m": 0.1}, ("mast", "1-junction")),
        ({"at": "load_cell", "low_m": 0.0, "high_m": 0.1}, ("load_cell", "1-junction")),
        ({"at": "shaft", "low_m": 0.0, "high_m": 0.1}, ("shaft", "displacement")),
        ({"at": "nut", "low_m": 0.0, "high_m": 0.1, "within_m": 0.05}, ("within_m", "0.05")),
        ({"at": "nut", "low_m": 0.0}, ("high_m", "missing")),
        ({"at": "nut", "low_m": 0.0, "high_m": 0.1, "end": 1}, ("unknown key", "end")),
    ],
)
def test_what_cannot_be_a_travel_is_refused(travel: dict[str, Any], words: tuple[str, ...]) -> None:
    with pytest.raises(ConfigurationError) as refused:
        described(**travel)
    for word in ("actuator.yaml: travel", *words):
        assert word in str(refused.value)
