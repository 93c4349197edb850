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

from __future__ import annotations

from copy import deepcopy

from flea_diag.core.residuals.parameters import ActuatorParameters


def test_a_frozen_value_is_its_own_deep_copy():
    values = {"read": ActuatorParameters(), "written": [1.0]}
    copied = deepcopy(values)
    assert copied["read"] is values["read"]
    assert copied["written"] == values["written"]
    assert copied["written"] is not values["written"]
