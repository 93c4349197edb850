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

from dataclasses import replace

import numpy as np
import pytest
from support.models import linear_ema as ema
from support.observed import FLEA_COUNTS, flea_parameters

from flea_diag.configuration import description
from flea_diag.configuration.calibrations import learned
from flea_diag.configuration.description import compiled_relations
from flea_diag.configuration.stand import load_stand
from flea_diag.core.residuals.parameters import UNIT_PARAMETERS
from flea_diag.core.residuals.residual_bank import ResidualBank

FLEA = compiled_relations("actuator.yaml").residuals

TRUE = flea_parameters(
    force_constant_n_per_a=170.0,
    back_emf_v_s_per_m=170.0,
    winding_resistance_ohm=3.1,
    current_offset_a=0.25,
    voltage_offset_v=-0.8,
    coulomb_friction_n=60.0,
    viscous_friction_n_s_per_m=500.0,
    reflected_mass_kg=120.0,
    motor_heating_k_per_a2s=0.0098,
    motor_cooling_s=800.0,
    encoder_m_per_rad=5e-4,
)
KNOWN, ALONE = (
    description.compiled_relations("actuator.yaml", FLEA.channels, encoder)
    for encoder in (True, False)
)
DELAY = 15
WHOLE = ema.run()


def residuals(columns: ema.Columns, channels: tuple[str, ...] = FLEA.channels) -> np.ndarray:
    bank = ResidualBank(TRUE, KNOWN, period_s=0.01, counts=FLEA_COUNTS)
    return bank.step(ema.rows(columns, channels), False).values


def cruising(columns: ema.Columns) -> np.ndarray:
    """Scans whose whole smoothing window lies in motion one way, without the start."""
    speed = columns["motor_speed"] * 5e-4
    steady = np.abs(speed) > 0.03
    windows = np.lib.stride_tricks.sliding_window_view(steady & (np.abs(speed) < 0.05), 31)
    return np.flatnonzero(windows.all(axis=1)) + 30


def bank_rows() -> list[str]:
    return [row.name for row in FLEA.rows]


def test_channels_and_names_are_those_of_the_stand():
    assert FLEA.channels == ema.CHANNELS
    assert len(set(bank_rows())) == len(FLEA.rows)


def test_a_healthy_actuator_leaves_nothing():
    found, use = residuals(WHOLE), cruising(WHOLE)
    assert len(use) > 500
    largest = {name: np.abs(found[use, j]).max() for name, j in FLEA.place.items()}
    assert largest["parity_mechanical"] < 3.0
    assert largest["parity_electrical"] < 0.02
    assert largest["parity_drive"] == pytest.approx(0.8, abs=1e-9)  # its own offset is not given
    assert largest["parity_kinematic"] < 1e-12
    assert largest["parity_speed"] < 1e-4


TRUE_SIGNALS = {
    "i": lambda c: c["motor_current"] - 0.25,
    "v": lambda c: c["motor_speed"] * 5e-4,
    "s": lambda c: np.sign(c["motor_speed"]),
    "F": lambda c: c["load_force"],
    "1": lambda c: np.ones_like(c["load_force"]),
}
PLANT = {
    # fault: parameters, and (residual, coefficient of each true signal)
    "jam": (
        {"coulomb": 200.0, "viscous": 1500.0},
        {"parity_mechanical": {"s": 140.0, "v": 1000.0}, "parity_electrical": {}},
    ),
    "winding_short": (
        {"resistance": 0.8 * 3.1, "back_emf": 0.85 * 170, "force_constant": 0.85 * 170},
        {
            "parity_mechanical": {"i": 0.15 * 170},
            "parity_electrical": {"i": -0.2 * 3.1, "v": -0.15 * 170},
        },
    ),
    "heavier": ({"mass": 240.0}, {"parity_electrical": {}}),
}
SENSOR = {
    "motor_current_bias": (
        ("motor_current", lambda y: y + 0.5),
        {"parity_mechanical": {"1": 85.0}, "parity_electrical": {"1": -1.55}},
    ),
    "motor_current_scaling": (
        ("motor_current", lambda y: 0.25 + 1.2 * (y - 0.25)),
        {"parity_mechanical": {"i": 34.0}, "parity_electrical": {"i": -0.62}},
    ),
    "load_force_bias": (
        ("load_force", lambda y: y + 50.0),
        {"parity_mechanical": {"1": -50.0}, "parity_electrical": {}},
    ),
    "motor_voltage_bias": (
        ("motor_voltage", lambda y: y + 2.0),
        {"parity_mechanical": {}, "parity_electrical": {"1": 2.0}, "parity_drive": {"1": 1.2}},
    ),
    "actuator_position_bias": (
        ("actuator_position", lambda y: y + 0.003),
        {"parity_kinematic": {"1": 0.003}, "parity_mechanical": {}, "parity_electrical": {}},
    ),
    "load_position_bias": (
        ("load_position", lambda y: y + 0.003),
        {"parity_kinematic": {"1": -0.003}, "parity_mechanical": {}},
    ),
    "motor_speed_scaling": (
        ("motor_speed", lambda y: 1.1 * y),
        {"parity_electrical": {"v": -17.0}, "parity_mechanical": {"v": -50.0}},
    ),
}
LIMITS = {"parity_mechanical": 4.0, "parity_electrical": 0.05, "parity_kinematic": 1e-9}


def check(columns: ema.Columns, truth: ema.Columns, expected: dict) -> None:
    found, use = residuals(columns), cruising(truth)
    for name, coefficients in expected.items():
        want = sum(k * TRUE_SIGNALS[s](truth)[use - DELAY] for s, k in coefficients.items())
        got = found[use, FLEA.place[name]]
        np.testing.assert_allclose(
            got, want + np.zeros(len(use)), atol=LIMITS.get(name, 1e-6), rtol=0.02, err_msg=name
        )


@pytest.mark.parametrize("fault", PLANT)
def test_a_fault_of_the_plant_moves_its_residuals_as_the_equations_say(fault):
    parameters, expected = PLANT[fault]
    columns = ema.run(ema.changed(**parameters))
    check(columns, columns, expected)


@pytest.mark.parametrize("fault", SENSOR)
def test_a_sensor_fault_moves_its_residuals_as_the_equations_say(fault):
    (channel, error), expected = SENSOR[fault]
    check({**WHOLE, channel: error(WHOLE[channel])}, WHOLE, expected)


def test_normalised_by_direction_a_drag_keeps_its_sign_and_a_bias_alternates():
    jam = ema.run(ema.changed(coulomb=200.0))
    biased = {**WHOLE, "motor_current": WHOLE["motor_current"] + 0.5}
    for columns, raw_sign_is_kept in ((jam, False), (biased, True)):
        found, use = residuals(columns), cruising(columns)
        raw = np.sign(found[use, FLEA.place["parity_mechanical"]])
        normalised = np.sign(found[use, FLEA.place["parity_mechanical_dn"]])
        assert (np.unique(raw).tolist() == [1.0]) is raw_sign_is_kept
        assert (np.unique(normalised).tolist() == [1.0]) is not raw_sign_is_kept


@pytest.mark.slow
def test_without_an_encoder_the_slope_of_the_position_is_the_speed():
    channels = tuple(c for c in FLEA.channels if c != "motor_speed")
    bank = ResidualBank(
        flea_parameters(coulomb_friction_n=60.0), ALONE, period_s=0.01, counts=FLEA_COUNTS
    )
    assert not bank.has_encoder
    speeds = bank.step(ema.rows(WHOLE, channels), False).speed_m_s
    use = cruising(WHOLE)
    true = WHOLE["motor_speed"][use - DELAY] * 5e-4
    np.testing.assert_allclose(speeds[use], true, rtol=0.01)


def test_a_gap_empties_the_windows_and_keeps_the_temperatures():
    bank = ResidualBank(TRUE, KNOWN, period_s=0.01, counts=FLEA_COUNTS)
    table = ema.rows(WHOLE)
    before = bank.step(table[:500], False)
    bank.interrupt()
    after = bank.step(table[500:501], False)
    assert np.isfinite(before.values[-1, FLEA.place["parity_mechanical"]])
    assert np.isnan(after.values[0, FLEA.place["parity_mechanical"]])
    assert abs(after.values[0, FLEA.place["motor_temperature"]]) < 1.0


def test_what_is_missing_takes_only_its_own_residuals():
    columns = {**WHOLE, "motor_voltage": np.full(len(WHOLE["load_force"]), np.nan)}
    use = cruising(WHOLE)
    found = residuals(columns)[use[use > 200]]
    for row in (row for row in FLEA.rows if row.gate != "sensor"):
        lacking = np.isnan(found[:, FLEA.place[row.name]])
        assert lacking.all() if "motor_voltage" in row.needs else not lacking.any(), row.name


def test_adopted_parameters_count_from_then_on():
    bank, other = (
        ResidualBank(TRUE, KNOWN, period_s=0.01, counts=FLEA_COUNTS),
        ResidualBank(TRUE, KNOWN, period_s=0.01, counts=FLEA_COUNTS),
    )
    other.adopt(replace(TRUE, current_offset_a=0.35))
    rows = ema.rows(WHOLE)[:200]
    plain, moved = bank.step(rows, False), other.step(rows, False)
    j = FLEA.place["parity_mechanical"]
    assert plain.values[-1, j] - moved.values[-1, j] == pytest.approx(17.0)
    assert plain.spread.shape == (200, 4, len(UNIT_PARAMETERS))
    assert FLEA.index["motor_current"] == 0


def standing(current_a: float, load_n: float, scans: int = 100) -> ema.Columns:
    """An actuator that does not move, with a constant current and load."""
    still = {name: np.zeros(scans) for name in FLEA.channels}
    return {
        **still,
        "motor_current": np.full(scans, 0.25 + current_a),
        "load_force": np.full(scans, load_n),
    }


@pytest.mark.parametrize(
    ("current_a", "load_n", "way"),
    [(2.0, 40.0, 1.0), (-2.0, -40.0, -1.0), (0.0, 300.0, -1.0), (1.0, 40.0, 0.0)],
)
def test_what_withstands_too_great_a_push_is_stalled(current_a, load_n, way):
    # Dry friction is 60 N: pushes of 300 N either way, 300 N of load alone, and 130 N.
    found = ResidualBank(TRUE, KNOWN, period_s=0.01, counts=FLEA_COUNTS).step(
        ema.rows(standing(current_a, load_n), FLEA.channels), False
    )
    stalled = np.arange(100) >= 61  # one kernel to see anything, and another of standing
    assert found.moving.tolist() == (stalled & (way != 0.0)).tolist()
    assert np.all(found.motion[:, 1][stalled] == way)
    lacking = abs(170.0 * current_a - load_n) - 60.0 * abs(way)
    normalised = found.values[stalled, FLEA.place["parity_mechanical_dn"]]
    assert np.abs(normalised) == pytest.approx(lacking)


def test_a_reversal_is_no_standstill():
    columns = standing(2.0, 40.0)
    columns["motor_speed"][::45] = 4000.0  # a kernel of 31 scans around each sees it move
    found = ResidualBank(TRUE, KNOWN, period_s=0.01, counts=FLEA_COUNTS).step(
        ema.rows(columns, FLEA.channels), False
    )
    speed = found.speed_m_s
    still = np.abs(speed[31:]) <= 0.01
    assert still.any()
    assert not found.moving[31:][still].any()


@pytest.mark.parametrize("block", [1, 500])
@pytest.mark.parametrize("backend", ["numpy", "numba"])
def test_the_motion_is_by_the_reading_that_friction_holds(backend, block):
    """That of the joint holds the slope of its position, in which no error of the speed is."""
    if backend == "numba":
        pytest.importorskip("numba")
    known = compiled_relations(str(load_stand("joint").actuator))
    true = learned(load_stand("joint")).parameters
    t = np.minimum(0.01 * np.arange(500), 4.0)  # it stands for the last second
    rows = np.zeros((500, len(known.residuals.channels)))
    rows[:, known.residuals.channel("actuator_position")] = 2.0 - np.cos(np.pi * t)
    found = []
    for speed in (0.0, 30.0):
        rows[:, known.residuals.channel("motor_speed")] = speed
        bank = ResidualBank(
            true, known, backend=backend, period_s=0.01, counts=FLEA_COUNTS, most_supplied={}
        )
        parts = [bank.step(rows[i : i + block], frozen=False) for i in range(0, 500, block)]
        motion = np.concatenate([part.motion for part in parts])[31:]
        found.append((motion, np.concatenate([part.moving for part in parts])[31:]))
    (motion, moving), other = found
    assert motion.tobytes() == other[0].tobytes()
    assert moving.tobytes() == other[1].tobytes()
    slope = np.pi * np.sin(np.pi * t)[31 - DELAY : -DELAY]
    clear = np.abs(slope) > 1.0
    assert (np.sign(slope) * motion[:, 1] > 0.9)[clear].all()
    assert moving[clear].all()
    assert not moving[-40:].any()


@pytest.mark.slow
@pytest.mark.parametrize("block", [1, 97, 4000])
@pytest.mark.parametrize("encoder", [5e-4, 0.0])
def test_compiled_gives_the_bits_of_python(block, encoder):
    """In motion, stalled, with readings that are missing, offsets learned, and frozen."""
    pytest.importorskip("numba")
    rows = ema.rows(standing(9.0, 0.0), FLEA.channels)
    rows = np.concatenate((ema.rows(WHOLE, FLEA.channels), rows))
    draw = np.random.default_rng(6)
    rows[draw.random(rows.shape) < 0.002] = np.nan
    rows[300:900, FLEA.index["motor_current"]] = np.nan  # leaves a temperature unjudged
    parameters = replace(TRUE, encoder_m_per_rad=encoder, nut_heating_k_per_j=1e-4)
    known = KNOWN if encoder else ALONE
    banks = [
        ResidualBank(
            parameters,
            known,
            backend=backend,
            period_s=0.01,
            counts=FLEA_COUNTS,
            most_supplied={"motor_temperature": 0.1},
        )
        for backend in ("numpy", "numba")
    ]
    moved = unheated = 0
    for start in range(0, len(rows), block):
        if start >= 700 > start - block:
            for bank in banks:
                bank.adopt(replace(parameters, current_offset_a=-0.1))
        part = rows[start : start + block]
        one, other = (bank.step(part, frozen=start > 1000) for bank in banks)
        assert one.values.tobytes() == other.values.tobytes()
        assert one.spread.tobytes() == other.spread.tobytes()
        assert one.moving.tobytes() == other.moving.tobytes()
        assert one.signals.tobytes() == other.signals.tobytes()
        assert one.motion.tobytes() == other.motion.tobytes()
        moved += int(one.moving.sum())
        read = ~np.isnan(part[:, FLEA.index["motor_temperature"]])
        unheated += int(np.isnan(one.values[read, FLEA.place["motor_temperature"]]).sum())
    assert 0 < moved < len(rows)
    assert 200 < unheated < len(rows)
