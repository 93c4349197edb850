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

"""Which faults nothing tells apart: pairs worked out on paper from the relations."""

from __future__ import annotations

import pytest
from support.models.fault_terms import DRIVE, EFFECTS, ELECTRICAL, MECHANICAL
from support.observed import flea_parameters

from flea_diag.core.likelihood.fault_models import FaultModel, Size, Term
from flea_diag.core.likelihood.isolability import computable, isolable

MODELS, RESIDUALS = EFFECTS.bound(flea_parameters()), EFFECTS.residuals
FORCES = (MECHANICAL, "motor_temperature", "nut_temperature", "ambient_temperature")
ALL = (*FORCES, ELECTRICAL)


@pytest.mark.parametrize(
    ("faults", "residuals", "alike"),
    [
        # r = K b and r = -b: without the voltage each is the other.
        (("motor_current_bias", "load_force_bias"), FORCES, True),
        (("motor_current_bias", "load_force_bias"), ALL, False),
        (("motor_current_drift", "load_force_drift"), FORCES, True),
        (("motor_current_bias", "load_force_bias", "motor_current_drift"), FORCES, False),
        # What turns round with the motion is no constant.
        (("motor_current_bias", "jam"), FORCES, False),
        (("motor_current_scaling", "load_force_scaling"), FORCES, False),
        (("jam", "ball_nut_friction"), ALL, True),
        # A failed motor may be an open winding.
        (("winding_open", "motor_failure"), ALL, True),
        # Without the voltage an open winding shows in nothing.
        (("winding_open", "motor_failure"), FORCES, False),
        (("motor_temperature_bias", "nut_temperature_bias"), ALL, False),
    ],
)
def test_pairs(faults: tuple[str, ...], residuals: tuple[str, ...], alike: bool) -> None:
    assert isolable(MODELS, faults, residuals) is not alike
    assert isolable(MODELS, faults[::-1], residuals) is not alike


def test_a_space_is_the_same_whatever_it_is_spanned_by() -> None:
    def made(fault: str, *gains: tuple[float, float]) -> FaultModel:
        sizes = tuple(Size(str(k), "1", -1.0, 1.0) for k in range(len(gains)))
        pairs = [(name, g, k) for k, both in enumerate(gains)
                 for name, g in zip(("one", "load_force"), both, strict=True)]  # fmt: skip
        return FaultModel(fault, sizes, tuple(Term(MECHANICAL, *pair) for pair in pairs))

    models = (made("x", (1.0, 0.0), (0.0, 1.0)), made("y", (3.0, 1.0), (1.0, -2.0)),
              made("z", (1.0, 1.0), (2.0, 2.0)))  # fmt: skip
    assert not isolable(models, ("x", "y"), (MECHANICAL,))
    assert isolable(models, ("x", "z"), (MECHANICAL,))


def test_what_a_bad_channel_takes_away() -> None:
    assert computable(RESIDUALS, ALL, ("motor_voltage",)) == FORCES
    assert computable(RESIDUALS, (*ALL, DRIVE), ("commanded_voltage",)) == ALL
    assert computable(RESIDUALS, ALL, ("motor_current",)) == FORCES[1:]
    assert computable(RESIDUALS, ALL, ("load_position",)) == ALL


def test_terms_of_one_size_on_one_signal_add_up_and_what_shows_nowhere_is_like_nothing() -> None:
    def made(fault: str, *terms: tuple[str, float]) -> FaultModel:
        shown = tuple(Term(MECHANICAL, name, gain, 0) for name, gain in terms)
        return FaultModel(fault, (Size("size", "1", -1.0, 1.0),), shown)

    models = (
        made("once", ("one", 3.0), ("load_force", 1.0)),
        made("twice", ("one", 1.0), ("one", 2.0), ("load_force", 1.0)),
        made("other", ("one", 2.0), ("load_force", 1.0)),
        made("nowhere"),
        made("nothing"),
    )
    assert not isolable(models, ("once", "twice"), (MECHANICAL,))
    assert isolable(models, ("once", "other"), (MECHANICAL,))
    assert isolable(models, ("twice", "other"), (MECHANICAL,))
    assert isolable(models, ("once", "nowhere"), (MECHANICAL,))
    assert isolable(models, ("nowhere", "nothing"), (MECHANICAL,))


def test_a_fault_of_one_size_is_told_from_one_of_two_that_may_look_like_it() -> None:
    def made(fault: str, *gains: tuple[float, float]) -> FaultModel:
        sizes = tuple(Size(str(k), "1", -1.0, 1.0) for k in range(len(gains)))
        terms = tuple(
            Term(MECHANICAL, name, gain, k)
            for k, pair in enumerate(gains)
            for name, gain in zip(("one", "load_force"), pair, strict=True)
        )
        return FaultModel(fault, sizes, terms)

    models = made("line", (1.0, 0.0)), made("plane", (1.0, 0.0), (0.0, 1.0))
    assert isolable(models, ("line", "plane"), (MECHANICAL,))
    assert isolable(models, ("plane", "line"), (MECHANICAL,))
