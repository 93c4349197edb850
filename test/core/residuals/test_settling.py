"""Residuals that hold only some time after a stop."""

from __future__ import annotations

import copy

import numpy as np
import pytest
from support.models.stepper import DESCRIPTION

from flea_diag.core.bond_graph.actuator import actuator
from flea_diag.core.residuals.relation_compiler import relation_set
from flea_diag.core.residuals.residual_rows import ResidualRows
from flea_diag.core.residuals.residual_set import residual_set
from flea_diag.core.residuals.settling import Settling, scans_of, scans_since
from flea_diag.errors import ConfigurationError

HELD = tuple(DESCRIPTION["base_parameters"])[:-1]
MOVING = np.array([False, True, True, False, False, False, False, False, True, False])


def stepper(settles_s: float):
    content = copy.deepcopy(DESCRIPTION)
    content["residuals"]["parity_power"]["settles_s"] = settles_s
    model = actuator(content)
    return residual_set(model, relation_set(model, ["parity_power"], HELD, ("coulomb_friction_n",)))


def left(parts: list[np.ndarray]) -> list[bool]:
    """Where the balance has a value, in scans that come in these parts."""
    rows = stepper(0.08)
    settling = Settling(rows, 0.04, 3)
    found: list[bool] = []
    for moving in parts:
        n = len(moving)
        made = ResidualRows(
            np.ones((n, len(rows.rows))), np.empty(0), np.empty(0), np.empty(0), moving
        )
        settling.leave_out(made)
        found += np.isfinite(made.values[:, rows.place["parity_power"]]).tolist()
        others = np.delete(made.values, rows.place["parity_power"], axis=1)
        assert np.isfinite(others).all()
    return found


@pytest.mark.parametrize("cuts", [[], [1, 4], list(range(1, 10))])
def test_a_balance_is_void_for_its_time_and_half_a_kernel_after_a_stop(cuts: list[int]) -> None:
    # 0.08 s are two scans of 0.04 s, and half a kernel of three is one.
    void = {3, 4, 5, 9}
    assert left(np.split(MOVING, cuts)) == [k not in void for k in range(len(MOVING))]


def test_scans_are_counted_from_the_last_one_in_motion() -> None:
    assert scans_since(MOVING, 4).tolist() == [5, 0, 0, 1, 2, 3, 4, 5, 0, 1]
    assert scans_of(1.2, 0.04, 31) == 45
    assert scans_of(0.0, 0.04, 31) == 0


@pytest.mark.parametrize("time", [-0.1, float("inf")])
def test_a_time_that_is_none_is_refused(time: float) -> None:
    with pytest.raises(ConfigurationError, match=r"settles_s = .* (must be|below its limit)"):
        stepper(time)
