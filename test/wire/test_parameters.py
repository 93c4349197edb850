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

"""Values of parameters: types, bounds, and numbers that must be finite."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import pytest

from flea_diag.errors import ConfigurationError
from flea_diag.nodes.executables import EXECUTABLES, program_of
from flea_diag.wire.parameters import build, descriptors, parameter


@dataclass(frozen=True)
class Toy:
    """Parameters of each type; ``size`` may be left out, which NaN says."""

    free: float = parameter(1.0, "without bounds")
    least: float = parameter(1.0, "bounded below", unit="A", minimum=0.0)
    most: float = parameter(1.0, "bounded above", maximum=40.0)
    size: float = parameter(math.nan, "left out by default")
    count: int = parameter(3, "whole number")
    name: str = parameter("a", "text")
    on: bool = parameter(True, "switch")


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"free": math.nan}, "x.yaml: free = nan must be a finite number"),
        ({"free": math.inf}, "x.yaml: free = inf must be a finite number"),
        (
            {"free": 10**400},
            "x.yaml: free = a whole number of some 400 digits must",
        ),
        ({"least": math.nan}, "x.yaml: least = nan must be a finite number"),
        ({"least": math.inf}, "x.yaml: least = inf must be a finite number"),
        ({"least": -math.inf}, "x.yaml: least = -inf must be a finite number"),
        ({"most": math.inf}, "x.yaml: most = inf must be a finite number"),
        ({"most": -math.inf}, "x.yaml: most = -inf must be a finite number"),
        ({"size": math.inf}, "x.yaml: size = inf must be a finite number"),
        ({"free": "lots"}, "x.yaml: free = 'lots' must be a number"),
        ({"free": True}, "x.yaml: free = True must be a number"),
        ({"count": 1.5}, "x.yaml: count = 1.5 must be a whole number"),
        ({"name": 7}, "x.yaml: name = 7 must be text"),
        ({"on": "yes"}, "x.yaml: on = 'yes' must be true or false"),
        ({"fualt": 1}, "x.yaml: unknown parameter 'fualt', known are "),
    ],
)
def test_a_bad_value_is_refused_by_name(values: dict[str, Any], words: str) -> None:
    with pytest.raises(ConfigurationError) as refusal:
        build(Toy, values, "x.yaml")
    assert str(refusal.value).startswith(words)


def test_what_is_within_the_bounds_is_taken() -> None:
    taken = build(Toy, {"free": -1e300, "least": 0, "most": 40.0, "count": -7}, "x.yaml")
    assert (taken.free, taken.least, taken.most, taken.count) == (-1e300, 0.0, 40.0, -7)
    assert type(taken.least) is float
    assert math.isnan(build(Toy, {"size": math.nan}, "x.yaml").size)


@pytest.mark.parametrize("name", EXECUTABLES)
def test_no_number_of_any_node_may_be_infinite_or_unknown(name: str) -> None:
    parameters = program_of(name).parameters
    for entry in descriptors(parameters):
        if entry.kind is float:
            for value in (math.nan, math.inf, -math.inf):
                with pytest.raises(ConfigurationError, match=f"node: {entry.name} = "):
                    build(parameters, {entry.name: value}, "node")
