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

"""What a stand's sensors cannot show, however large: by which they are, and how fine its limits."""

from __future__ import annotations

from dataclasses import replace

import pytest

from flea_diag.configuration.calibrations import learned
from flea_diag.configuration.knowledge import knowledge
from flea_diag.configuration.stand import load_stand
from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.detection.mean_shift import MeanShiftLimit
from flea_diag.core.detection.window_limit import ResidualLimit, WindowLimit
from flea_diag.core.isolation.detectability import (
    smallest_detectable_offsets,
    undetectable,
    unseen_by_limits,
    without_relation,
)
from flea_diag.stages.isolator.quantitative_isolation import QuantitativeIsolation

SECOND = ("motor_speed", "load_position", "commanded_voltage")
LARGEST_M_S = 0.005
"""The fastest drift of a position that counts as its fault."""


def whole() -> Calibration:
    return learned(load_stand())


def single(electrical_v: float) -> Calibration:
    """The same stand with one position sensor; an offset of so many volts is found."""
    stand = whole()
    needed = ("parity_drive", "parity_kinematic", "parity_speed", "innovation_motor_speed")
    kept = [limit for limit in stand.limits if not limit.name.startswith(needed)]
    window = WindowLimit(400, (0.0,) * 3, (electrical_v / 5.0,) * 3, 5.0)
    limits = [
        replace(limit, windows=(window,)) if limit.name == "parity_electrical" else limit
        for limit in kept
    ]
    return replace(
        stand,
        channels=tuple(name for name in stand.channels if name not in SECOND),
        parameters=replace(stand.parameters, encoder_m_per_rad=0.0),
        limits=tuple(limits),
        shifts=(),
    )


def silent(stand: Calibration) -> tuple[str, ...]:
    known = knowledge(load_stand(), stand)
    models = QuantitativeIsolation(stand, known.effects).models
    return undetectable(known.faults, models, stand, known.effects.residuals.symptoms)


def test_with_an_encoder_and_a_second_position_nothing_of_a_sensor_stays_undetectable():
    assert silent(whole()) == ()


@pytest.mark.parametrize(("share", "expected"), [(1.1, ("actuator_position_drift",)), (0.9, ())])
def test_a_drift_of_the_only_position_shows_where_its_back_emf_passes_the_limit(share, expected):
    back_emf = whole().parameters.back_emf_v_s_per_m
    assert silent(single(share * back_emf * LARGEST_M_S)) == expected


def test_without_its_thermal_limits_a_temperature_shows_only_what_its_readings_tell():
    stand = single(10.0)
    limits = [limit for limit in stand.limits if limit.name != "motor_temperature"]
    found = silent(replace(stand, limits=tuple(limits)))
    modes = {name.removeprefix("motor_temperature_") for name in found if "motor_t" in name}
    assert modes == {"bias", "drift", "scaling"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("stand", "lacking", "expected"),
    [
        ("flea", (), set()),
        ("flea", ("load_force",), {"jam", "ball_nut_friction"}),
        ("flea", ("motor_voltage",), {"winding_open", "supply_open"}),
        ("joint", (), {"backlash"}),
    ],
)
def test_a_fault_of_the_plant_that_no_relation_holds_is_named(
    stand: str, lacking: tuple[str, ...], expected: set[str]
) -> None:
    """Friction is in the balance with the load, an open circuit in that of voltages.

    config/stands/joint/README.md lists what its sensors show nothing of.
    """
    files = load_stand(stand)
    calibration = learned(files)
    names = tuple(name for name in calibration.channels if name not in lacking)
    known = knowledge(files, replace(calibration, channels=names))
    models = QuantitativeIsolation(calibration, known.effects).models
    found = {f.name for f in without_relation(known.faults, models, known.calibration)}
    assert expected <= found
    assert found == expected or lacking


HEAT_K_PER_S = {
    "joint": 0.75 * 1.8**2 / 450.0,
    "shoulder": 0.45 * 3.0**2 / 620.0,
    "axis": 3.0 * 0.9**2 / 850.0,
}
"""R I^2 / C of their data sheets, at the current that their descriptions hold."""


@pytest.mark.parametrize("stand", list(HEAT_K_PER_S))
def test_a_resistance_that_no_voltage_shows_is_said_to_be_unseen(stand: str) -> None:
    """Six times the resistance heats a motor by less than its thermometer would have to drift."""
    law = learned(load_stand(stand)).law
    assert law is not None
    rows = {row.fault: row for row in law.visible}
    assert "winding_resistance_rise" in unseen_by_limits(law.visible)
    gained = rows["winding_resistance_rise"].largest * HEAT_K_PER_S[stand]
    assert gained < 0.5 * rows["motor_temperature_drift"].limits


def test_the_least_offset_is_that_of_the_finest_test():
    windows = (
        WindowLimit(50, (0.0,) * 3, (2.0, 3.0, 4.0), 6.0),
        WindowLimit(400, (0.0,) * 3, (1.5, 2.0, 2.0), 6.0),
    )
    limits = (ResidualLimit("parity_mechanical", windows, (1.0,) * 3),)
    stand = replace(whole(), limits=limits, shifts=())
    assert smallest_detectable_offsets(stand) == {"parity_mechanical": 9.0}
    shifts = (MeanShiftLimit("parity_mechanical", 400, 1.0, 5.0),)
    assert smallest_detectable_offsets(replace(stand, shifts=shifts)) == {"parity_mechanical": 5.0}
