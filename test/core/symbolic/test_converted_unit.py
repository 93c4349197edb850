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

"""Units of others, against values of tables."""

from __future__ import annotations

import pytest

from flea_diag.core.symbolic.converted_unit import CONVERTED, conversion, conversion_to
from flea_diag.core.symbolic.unit import dimension
from flea_diag.errors import ConfigurationError


@pytest.mark.parametrize(
    ("value", "unit", "wanted", "expected"),
    [
        (25.4, "mm", "m", 0.0254),
        (180.0, "deg", "rad", 3.141592653589793),
        (3000.0, "rpm", "rad/s", 314.1592653589793),
        (100.0, "lbf", "N", 444.82216152605),
        (2.0, "kgf", "N", 19.6133),
        (1.0, "lbf*in", "N*m", 0.1129848290276167),
        (212.0, "degF", "degC", 100.0),
        (-40.0, "degF", "degC", -40.0),
        (273.15, "K", "degC", 0.0),
        (1.0, "rad", "1", 1.0),
        (7.0, "V*s/rad", "V*s/rad", 7.0),
    ],
)
def test_a_value_is_converted(value: float, unit: str, wanted: str, expected: float) -> None:
    found = conversion_to(unit, wanted, "here")
    assert found.unit == wanted
    assert found(value) == pytest.approx(expected, rel=1e-12, abs=1e-12)


def test_every_unit_leads_to_one_that_descriptions_know() -> None:
    for unit, (si, factor, _) in CONVERTED.items():
        assert dimension(si)
        assert factor > 0.0
        assert conversion(unit, "here").unit == si


@pytest.mark.parametrize(
    ("unit", "words"),
    [("stone", "unit 'stone' is unknown; use SI"), ("mm", "cannot be converted to N; use N or kN")],
)
def test_another_unit_is_refused(unit: str, words: str) -> None:
    with pytest.raises(ConfigurationError, match=words):
        conversion_to(unit, "N", "channels.yaml: load_force")
