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

"""The stand's physics against closed forms, its bytes, and what a switch of units shows."""

from __future__ import annotations

import hashlib
from itertools import pairwise

import numpy as np
import pytest
from support.stand_runs import SLOW, fault, records, scans, scenario, vibration

from flea_diag.errors import ConfigurationError
from flea_diag.wire.records import NEVER_NS, ChannelTable, Record, Scan, Truth, VibrationBlock
from flea_diag.wire.topics import TOPIC_OF
from flea_sim_driver.acquisition.recording import MOTIONS
from flea_sim_driver.machine.library import find_machine
from flea_sim_driver.plant import plant
from flea_sim_driver.plant.actuator import ActuatorPlant, coefficients
from flea_sim_driver.stand import SimulatedStand

AT_25_DEGC = {"unit_spread": 0.0, "ambient_degc": 23.6, "warm_degc": 1.4}
FLEA = find_machine("flea")
CURRENT_OFFSET_A, VOLTAGE_OFFSET_V = 0.32, -1.35
RESISTANCE_OHM, FORCE_CONSTANT = 2.95, 176.7
WITH_VIBRATION = {"sensors": {}, "duration_s": 3.0}


def digest(run: list[Record]) -> str:
    """Hash of everything in a run."""
    return hashlib.sha256(repr(run).encode()).hexdigest()


def test_records_come_in_stamp_order_and_complete() -> None:
    run = records(**WITH_VIBRATION)
    order = [(record.stamp_ns, TOPIC_OF[type(record)].rank) for record in run]
    assert order == sorted(order)
    assert sum(isinstance(record, Scan) for record in run) == 300
    blocks = [record for record in run if isinstance(record, VibrationBlock)]
    assert [block.count for block in blocks] == [2000] * 30
    assert [type(record) for record in run[:2]] == [ChannelTable, Truth]
    stamps = np.array([record.stamp_ns for record in run if isinstance(record, Scan)])
    assert set(np.diff(stamps)) == {10_000_000}
    assert stamps[0] > 10**18  # a real epoch: ros2 bag play waits for ever near zero


def test_vibration_samples_are_evenly_spaced_through_block_edges() -> None:
    run = records(sensors={"vibration_rate_hz": 64000.0}, duration_s=0.3)
    blocks = [record for record in run if isinstance(record, VibrationBlock)]
    times = np.concatenate(
        [b.stamp_ns - blocks[0].stamp_ns + b.points()[0].astype(int) for b in blocks]
    )
    assert len(times) == 19200
    assert np.abs(times - np.arange(19200) * 15625).max() <= 1


def test_equal_seeds_give_equal_bytes_and_others_differ() -> None:
    first, again = digest(records(**WITH_VIBRATION)), digest(records(**WITH_VIBRATION))
    other = digest(records(**WITH_VIBRATION, seed=2))
    assert first == again
    assert first != other


def test_another_seed_is_another_unit() -> None:
    first, other = (SimulatedStand(scenario(seed=seed)).units["Y"] for seed in (1, 2))
    assert first.winding_resistance_ohm != other.winding_resistance_ohm
    spread = [
        SimulatedStand(scenario(seed=seed)).units["Y"].winding_resistance_ohm / 2.95
        for seed in range(60)
    ]
    assert 0.03 < np.std(spread) < 0.07  # drawn with 5 %
    assert (
        SimulatedStand(scenario(seed=2, unit_spread=0.0)).units["X"]
        == SimulatedStand(scenario(seed=1, unit_spread=0.0)).units["X"]
    )


def test_steady_speed_draws_the_current_and_voltage_of_the_closed_form() -> None:
    run = scans(
        records(
            motion={"kind": "triangle", "amplitude_m": 0.04, "frequency_hz": 0.1, "centre_m": 0.05},
            duration_s=20.0,
            **AT_25_DEGC,
        )
    )
    for steady in (slice(350, 700), slice(850, 1200)):
        speed = run["motor_speed"][steady].mean() * 3.175e-3 / (2.0 * np.pi)
        load = run["load_force"][steady].mean()
        current = run["motor_current"][steady].mean() - CURRENT_OFFSET_A
        voltage = run["motor_voltage"][steady].mean() - VOLTAGE_OFFSET_V
        # Friction regressed from the real recordings: 47 N dry, 412 N s/m viscous.
        expected = (load + 412.0 * speed + 45.0 * np.sign(speed)) / FORCE_CONSTANT
        assert current == pytest.approx(expected, abs=0.04)
        assert voltage == pytest.approx(RESISTANCE_OHM * current + FORCE_CONSTANT * speed, rel=0.01)


def test_a_stalled_motor_heats_as_the_real_one() -> None:
    run = scans(
        records(
            motion={"kind": "hold", "centre_m": 0.05},
            duration_s=90.0,
            **AT_25_DEGC,
            **fault("actuator_position_dead", 0.5),
        )
    )
    late = slice(4000, 6500)
    time = np.arange(len(run["motor_current"]))[late] / 100.0
    slope = np.polyfit(time, run["motor_temperature"][late], 1)[0]
    square = np.mean((run["motor_current"][late] - CURRENT_OFFSET_A) ** 2)
    # 0.0096 to 0.0102 K/(A^2 s) at room temperature; the hot winding has a quarter more ohm.
    assert 0.0096 < slope / square < 0.0135


def test_a_jam_shrinks_the_stroke_as_on_the_real_stand() -> None:
    def half_stroke(**values: object) -> float:
        run = scans(
            records(motion=MOTIONS["sine1"], load={"constant_n": -11.0}, duration_s=14.0, **values)
        )
        low, high = np.percentile(run["load_position"][300:], [1.0, 99.0])
        return float(high - low) * 500.0

    nominal, jammed = half_stroke(), half_stroke(**fault("jam", 0.0))
    assert 12.5 < nominal < 16.0  # mm; 14.0 to 15.0 in the real runs of this motion and load
    assert 7.0 < jammed < 10.5  # 8.4 to 8.9 there
    assert jammed < 0.75 * nominal


def test_a_load_lets_go_and_catches_as_on_the_real_stand() -> None:
    """Moved against its command the load actuator brakes, lets go, and catches the run-away."""
    run = scans(records(motion=MOTIONS["triang3"], load={"constant_n": -127.0}, duration_s=20.0))
    speed = np.gradient(np.convolve(run["load_position"], np.ones(9) / 9, "same"), 0.01)[400:-50]
    against = speed[speed < -2e-3]
    assert np.percentile(against, 5.0) < -0.055  # m/s; slips at 65 to 90 mm/s in the real runs
    assert np.median(against) > -0.045
    with_it = speed[speed > 2e-3]
    assert np.percentile(with_it, 95.0) < 0.075  # no slips that way
    assert 450.0 < np.percentile(np.abs(run["load_force"]), 99.5) < 1000.0  # N
    assert np.percentile(run["load_force"][400:], 95.0) < 200.0


def test_a_dead_position_sensor_in_the_loop_runs_the_plant_to_its_stop() -> None:
    run = scans(records(**fault("actuator_position_dead")))
    position, speed = run["load_position"], run["motor_speed"] * 3.175e-3 / (2.0 * np.pi)
    arrived = int(np.argmax(position >= 0.0999))
    assert 500 < arrived < 650
    assert 0.06 < speed[500:arrived].max() < 0.125  # m/s; 71 to 112 mm/s in the real run-aways
    assert np.all(run["actuator_position"][500:] == 0.0)
    assert np.all(position[arrived + 50 :] == 0.1)  # the potentiometer clips there


def test_numba_gives_the_bits_of_plain_python() -> None:
    pytest.importorskip("numba", reason="needs numba to compare with")
    values = coefficients(FLEA.unit, FLEA.bench)._replace(spall=6.0)
    steps = 6000
    time = np.arange(steps) * plant.STEP_S
    draw = np.random.default_rng(1).standard_normal((steps, 3))
    inputs = (0.05 + 0.02 * np.sin(8.0 * time), np.full(steps, 120.0), draw)
    fast = ActuatorPlant.at_rest(FLEA.bench, 0.05).advance([(steps, values)], *inputs)
    plain = np.empty_like(fast)
    state = ActuatorPlant.at_rest(FLEA.bench, 0.05).state
    plant._integrate(state, *inputs, values, plant.STEP_S, plain)
    np.testing.assert_array_equal(fast, plain)


def test_energy_is_not_made() -> None:
    """Electrical energy in is at least what the load takes out, over whole cycles."""
    bench, values = FLEA.bench, coefficients(FLEA.unit, FLEA.bench)
    steps = 16000
    time = np.arange(steps) * plant.STEP_S
    reference = 0.05 + 0.02 * np.sin(np.pi * time)
    actuator = ActuatorPlant.at_rest(bench, 0.05)
    out = actuator.advance(
        [(steps, values)], reference, np.full(steps, 100.0), np.zeros((steps, 3))
    )
    column = {name: out[8000:, k] for k, name in enumerate(plant.SIGNALS)}
    electrical = np.mean(column["voltage"] * column["current"])
    copper = np.mean(column["current"] ** 2) * RESISTANCE_OHM
    load = np.mean(column["force"] * column["speed"])
    friction = np.mean(column["friction_power"])
    assert electrical == pytest.approx(copper + load + friction, rel=0.06)


def test_nothing_but_physics_betrays_a_switch_of_units() -> None:
    run = records(switch={"at_s": 5.0, "to": "X"})
    plain = records()
    assert [type(record) for record in run] == [type(record) for record in plain]
    tables = [record for record in run if isinstance(record, ChannelTable)]
    assert tables == [record for record in plain if isinstance(record, ChannelTable)]
    before, after = (
        {name: values[:500] for name, values in scans(each).items()} for each in (run, plain)
    )
    for name in before:
        np.testing.assert_array_equal(before[name], after[name])
    switched, stayed = scans(run), scans(plain)
    assert not np.array_equal(switched["motor_current"][500:], stayed["motor_current"][500:])
    text = " ".join(repr(record) for record in tables)
    assert "'X'" not in text
    assert "'Y'" not in text


def test_the_other_unit_may_be_warmer() -> None:
    warm = scans(records(switch={"at_s": 5.0, "to": "X", "warmer_k": 12.0}))
    alike = scans(records(switch={"at_s": 5.0, "to": "X"}))
    for name in ("motor_temperature", "nut_temperature"):
        np.testing.assert_array_equal(warm[name][:500], alike[name][:500])
        # It cools while it waits.
        assert np.median(warm[name][500:] - alike[name][500:]) == pytest.approx(12.0, abs=1.0)


def test_a_fault_of_the_other_unit_begins_with_the_switch() -> None:
    run = records(switch={"at_s": 6.0, "to": "X"}, faults=[{"fault": "jam", "unit": "X"}])
    truth = [record for record in run if isinstance(record, Truth)][-1]
    start = run[0].stamp_ns
    assert (truth.fault, truth.onset_ns) == ("jam", start + 6_000_000_000)
    current = scans(run)["motor_current"]
    assert np.std(current[600:]) > 1.3 * np.std(current[200:600])


def test_faults_come_and_go_live_with_exact_truth() -> None:
    stand = SimulatedStand(scenario())
    run: list[Record] = []
    for block in range(60):
        if block == 20:
            told = stand.inject("motor_current_bias", 2.0)
        if block == 40:
            stand.clear()
        run += stand.advance()
    truths = [record for record in run if isinstance(record, Truth)]
    start = run[0].stamp_ns
    assert [truth.fault for truth in truths] == ["nominal", "motor_current_bias", "nominal"]
    assert truths[0].onset_ns == NEVER_NS
    assert told.onset_ns == truths[1].onset_ns == start + 2_000_000_000
    plain = scans(records(duration_s=6.0))["motor_current"]
    added = scans(run)["motor_current"] - plain
    np.testing.assert_allclose(added[:200], 0.0)
    np.testing.assert_allclose(added[200:400], 2.0)
    np.testing.assert_allclose(added[400:], 0.0)
    with pytest.raises(ConfigurationError, match="rust"):
        stand.inject("rust")


def test_clock_jitter_and_losses_are_as_asked() -> None:
    run = records(sensors={**SLOW, "jitter_s": 2e-4, "scan_loss": 0.1}, duration_s=30.0)
    stamps = np.array([record.stamp_ns for record in run if isinstance(record, Scan)])
    assert all(later > earlier for earlier, later in pairwise(stamps))
    assert len(stamps) / 3000 == pytest.approx(0.9, abs=0.03)
    off_grid = (stamps - run[0].stamp_ns + 5_000_000) % 10_000_000 - 5_000_000
    assert np.std(off_grid) == pytest.approx(2e5, rel=0.1)


def test_sensors_show_noise_resolution_and_offsets_of_the_real_ones() -> None:
    run = scans(records(motion={"kind": "hold"}, duration_s=20.0, unit_spread=0.0))
    assert np.std(run["motor_current"][300:]) == pytest.approx(0.053, rel=0.15)
    assert np.std(run["load_position"][300:]) == pytest.approx(0.06e-3, rel=0.15)
    assert np.std(run["ambient_temperature"]) == pytest.approx(0.003, rel=0.3)
    assert (
        0.35
        < 1.4826 * np.median(np.abs(run["motor_temperature"] - np.median(run["motor_temperature"])))
        < 0.6
    )
    for channel, step in (("motor_current", 0.00087), ("load_position", 3.6e-6)):
        counts = run[channel] / step
        np.testing.assert_allclose(counts, np.round(counts), atol=1e-6)
    spikes = np.abs(run["motor_temperature"] - np.median(run["motor_temperature"])) > 4.0
    assert np.all(np.diff(np.flatnonzero(spikes)) > 1) or not spikes.any()  # single samples


def test_a_resting_stand_is_quiet_on_all_axes() -> None:
    run = vibration(records(motion={"kind": "hold"}, sensors={}, duration_s=3.0))
    assert np.all(np.std(run[20000:], axis=0) < 0.4)


def serials(**values: object) -> dict[str, str]:
    """Serial number of each channel."""
    table = records(duration_s=0.1, **values)[0]
    assert isinstance(table, ChannelTable)
    return {row.name: row.serial for row in table.channels}


def test_one_physical_unit_has_one_serial_number_and_no_other_has_it() -> None:
    plain = serials()["motor_current"]
    assert plain.startswith("SIM-")
    same = ({"load": {"constant_n": 50.0}}, fault("jam", 0.0), {"start_s": 2e9})
    assert {serials(**values)["motor_current"] for values in same} == {plain}
    others = ({"seed": 2}, {"active_unit": "X"}, {"unit_spread": 2.0})
    assert len({plain, *(serials(**values)["motor_current"] for values in others)}) == 4
    given = serials(serial="EMA-007", sensors={})
    assert given["accelerometer_2_z"] == given["motor_speed"] == "EMA-007"
    assert given["load_force"] == given["ambient_temperature"] == "", "these stay with the stand"


def test_after_a_switch_the_truth_and_nothing_else_names_the_other_unit() -> None:
    told = records(**fault("jam", 0.2, unit="X"), switch={"at_s": 0.1, "to": "X"}, duration_s=0.4)
    (jam,) = (r for r in told if isinstance(r, Truth) and r.fault == "jam")
    assert dict(jam.details)["serial"] == serials(active_unit="X")["motor_current"]
    (table,) = (r for r in told if isinstance(r, ChannelTable))
    assert table.info("motor_current").serial == serials()["motor_current"]  # type: ignore[union-attr]
