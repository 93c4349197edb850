from __future__ import annotations

from copy import deepcopy

from flea_diag.core.residuals.parameters import ActuatorParameters


def test_a_frozen_value_is_its_own_deep_copy():
    values = {"read": ActuatorParameters(), "written": [1.0]}
    copied = deepcopy(values)
    assert copied["read"] is values["read"]
    assert copied["written"] == values["written"]
    assert copied["written"] is not values["written"]
