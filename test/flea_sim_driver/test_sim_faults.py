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

"""Every fault of the catalogue acts, from its onset on, where it says and nowhere else."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
import pytest
import yaml
from support.places import ROOT
from support.stand_runs import Array, fault, records, scans, vibration

from flea_diag.wire.records import Truth
from flea_sim_driver.failure_modes import FAILURE_MODES
from flea_sim_driver.faults import MODES, catalogue, sensor_channels
from flea_sim_driver.machine.library import find_machine
from flea_sim_driver.scenario import table4

FLEA = find_machine("flea")
CATALOGUE, SENSOR_CHANNELS = catalogue(FLEA), sensor_channels(FLEA)
DURATION_S, ONSET_S, ONSET = 8.0, 4.0, 400
LOADED: dict[str, Any] = {"duration_s": DURATION_S, "load": {"amplitude_n": 150.0}}
MECHANICAL = ("motor_current", "motor_speed", "load_position")


@lru_cache(maxsize=1)
def nominal() -> dict[str, Array]:
    return scans(records(**LOADED))


def faulty(name: str, **options: Any) -> dict[str, Array]:
    return scans(records(**LOADED, **fault(name, ONSET_S, **options)))


def changed(run: dict[str, Array]) -> set[str]:
    """Channels that differ from the nominal run with the same seed, none before the onset."""
    for channel, values in run.items():
        np.testing.assert_array_equal(values[:ONSET], nominal()[channel][:ONSET], channel)
    return {name for name in run if not np.array_equal(run[name], nominal()[name])}


def test_the_catalogue_holds_every_id_that_the_diagnosis_knows() -> None:
    plant = {
        "jam", "spall", "ball_nut_friction", "backlash", "rotor_eccentricity", "winding_short",
        "winding_resistance_rise", "winding_open", "motor_failure", "supply_open", "supply_short",
        "supply_sag", "accelerometer_1_fault", "accelerometer_2_fault",
    }  # fmt: skip
    beyond = {
        "supply_noise", "capacitor_loss", "capacitor_runaway", "transistor_breakdown", "lead_leak",
    }  # fmt: skip
    sensors = {f"{channel}_{mode}" for channel in SENSOR_CHANNELS for mode in MODES}
    assert set(CATALOGUE) == plant | beyond | sensors
    assert len(SENSOR_CHANNELS) == 10


@pytest.mark.parametrize("channel", SENSOR_CHANNELS)
def test_a_sensor_fault_after_the_daq_moves_its_own_channel_alone(channel: str) -> None:
    true = nominal()[channel][ONSET:]
    age = np.arange(len(true)) / 100.0
    for mode in ("bias", "drift", "scaling", "dead"):
        run = faulty(f"{channel}_{mode}", where="daq")
        assert changed(run) == {channel}, mode
        size = CATALOGUE[f"{channel}_{mode}"].default_size
        expected = {"bias": true + size, "drift": true + size * age, "scaling": true * size,
                    "dead": np.full_like(true, size)}[mode]  # fmt: skip
        np.testing.assert_allclose(run[channel][ONSET:], expected, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("channel", SENSOR_CHANNELS)
def test_noise_and_drop_outs_are_as_large_as_said(channel: str) -> None:
    added = faulty(f"{channel}_noise", where="daq")[channel] - nominal()[channel]
    size = CATALOGUE[f"{channel}_noise"].default_size
    assert np.std(added[ONSET:]) == pytest.approx(size, rel=0.15)
    run = faulty(f"{channel}_dropout", size=4.0)
    assert changed(run) == {channel}
    lost = run[channel][ONSET:] == 0.0
    assert 0.05 < np.mean(lost) < 0.4  # 4 gaps of 50 ms a second


@pytest.mark.parametrize("name", [row.id for row in CATALOGUE.values() if row.places[0] == "loop"])
def test_a_sensor_fault_inside_the_loop_moves_the_plant(name: str) -> None:
    moved = changed(faulty(name))
    assert {"actuator_position", "load_position", "motor_current", "motor_voltage"} <= moved
    assert "ambient_temperature" not in moved


@pytest.mark.parametrize(
    ("name", "channels"),
    [("motor_current_bias", ("motor_voltage",)), ("load_force_bias", ("load_motor_current",))],
)
def test_other_loops_take_their_sensors_faults_where_asked(
    name: str, channels: tuple[str, ...]
) -> None:
    assert set(channels) <= changed(faulty(name, where="loop"))
    assert not set(channels) & changed(faulty(name))


@pytest.mark.parametrize("channel", ["actuator_position", "motor_current", "load_force"])
def test_noise_and_drop_outs_reach_the_loop_where_asked(channel: str) -> None:
    for mode in ("noise", "dropout"):
        inside = changed(faulty(f"{channel}_{mode}", where="loop"))
        assert "motor_voltage" in inside, mode
    lost = faulty(f"{channel}_dropout", where="loop", size=4.0)[channel][ONSET:] == 0.0
    again = faulty(f"{channel}_dropout", where="daq", size=4.0)[channel][ONSET:] == 0.0
    np.testing.assert_array_equal(lost, again)  # loop and DAQ lose the same samples


def ratio(name: str, channel: str, **options: Any) -> float:
    """Standard deviation of a channel under a fault over the nominal one, late in the run."""
    late = slice(ONSET + 150, None)
    return float(np.std(faulty(name, **options)[channel][late]) / np.std(nominal()[channel][late]))


def test_drag_takes_more_current_and_less_travel() -> None:
    for name in ("jam", "ball_nut_friction"):
        assert ratio(name, "motor_current") > 1.03
        assert ratio(name, "load_position") < 0.95
    assert ratio("jam", "load_position") < ratio("ball_nut_friction", "load_position")
    assert ratio("jam", "load_position", size=20.0) < 0.05  # a lock


def test_a_winding_short_needs_more_current_for_the_same_force() -> None:
    assert ratio("winding_short", "motor_current") == pytest.approx(1.0 / 0.8, rel=0.08)


@pytest.mark.parametrize("name", ["winding_open", "motor_failure", "supply_open"])
def test_without_current_nothing_is_driven(name: str) -> None:
    run = scans(records(**fault(name)))
    assert np.std(run["motor_current"][505:]) < 0.07  # noise alone
    assert np.ptp(run["load_position"][550:]) < 0.5e-3
    voltage = np.abs(run["motor_voltage"][550:] + 1.35)
    assert (voltage.max() > 2.0) == (name != "supply_open")  # the drive still tries, or cannot


def test_a_shorted_supply_brakes_and_an_open_one_coasts() -> None:
    free = scans(records())["motor_speed"]
    fastest = ONSET + int(np.argmax(np.abs(free[ONSET : ONSET + 200])))
    window = slice(fastest + 1, fastest + 8)
    drawn, turning = {}, {}
    for name in ("supply_short", "supply_open"):
        run = scans(records(**fault(name, fastest / 100.0)))
        drawn[name] = np.abs(run["motor_current"][window] - 0.32).max()
        turning[name] = np.abs(run["motor_speed"][window]).min()
        back_emf = (free if "short" in name else run["motor_speed"])[window] * 0.08929  # V s/rad
        shown = np.abs(run["motor_voltage"][window] + 1.35)
        if name == "supply_open":  # the terminals float at the back-EMF
            np.testing.assert_allclose(shown, np.abs(back_emf), atol=1.0)
        else:
            assert shown.max() < 0.25 * np.abs(back_emf).max()
    assert drawn["supply_short"] > 0.8
    assert drawn["supply_open"] < 0.2
    assert turning["supply_short"] < 0.7 * turning["supply_open"]


def test_faults_without_a_slow_trace_leave_the_mean_signals_alone() -> None:
    for name in ("spall", "rotor_eccentricity", "backlash"):
        for channel in MECHANICAL:
            assert ratio(name, channel) == pytest.approx(1.0, abs=0.05), (name, channel)
    for number in (1, 2):
        assert changed(faulty(f"accelerometer_{number}_fault")) == set()


def test_growth_and_intermittence_follow_the_scenario() -> None:
    grown = faulty("motor_current_bias", size=2.0, growth_s=2.0)["motor_current"]
    added = (grown - nominal()["motor_current"])[ONSET:]
    np.testing.assert_allclose(added[:200], 2.0 * np.arange(200) / 200.0, atol=1e-6)
    np.testing.assert_allclose(added[200:], 2.0)
    gaps = faulty("motor_current_bias", size=2.0, on_s=0.3, off_s=0.7)["motor_current"]
    added = (gaps - nominal()["motor_current"])[ONSET:]
    np.testing.assert_allclose(added, np.tile(np.r_[np.full(30, 2.0), np.zeros(70)], 4), atol=1e-6)


def test_truth_tells_fault_size_place_and_exact_onset() -> None:
    run = records(**LOADED, **fault("winding_short", 4.123, size=0.3))
    truth = [record for record in run if isinstance(record, Truth)]
    start = run[0].stamp_ns
    assert [each.fault for each in truth] == ["nominal", "winding_short"]
    assert truth[1].stamp_ns == truth[1].onset_ns == start + 4_120_000_000  # on the scan grid
    details = dict(truth[1].details)
    assert (details["size"], details["where"], details["approach"]) == ("0.3", "plant", "physics")


def test_each_failure_mode_of_the_paper_has_a_fault_that_shows_it() -> None:
    components = [row.component for row in FAILURE_MODES]
    assert len(FAILURE_MODES) == len({row.name for row in FAILURE_MODES}) == 25
    assert components.count("Sensor") == 4
    for row in FAILURE_MODES:
        assert row.fault in CATALOGUE
        assert row.approach in ("physics", "data", "hybrid")


def given(run: dict[str, Array]) -> Array:
    """Voltage that the drive gives less than it is commanded, after the onset."""
    way = np.sign(run["commanded_voltage"])
    return (way * (run["commanded_voltage"] - run["motor_voltage"] - 1.35))[ONSET + 20 :]


def test_ripple_of_the_supply_shows_beside_its_frequency_alone() -> None:
    """120 Hz, a mean over 10 ms each: a tenth of it is left, at 20 Hz."""
    added = faulty("supply_noise", size=0.2)["motor_voltage"] - nominal()["motor_voltage"]
    lines = np.abs(np.fft.rfft(added[ONSET:]))
    assert np.fft.rfftfreq(len(added[ONSET:]), 0.01)[np.argmax(lines)] == pytest.approx(20.0, abs=1)
    assert ratio("supply_noise", "load_position", size=0.2) == pytest.approx(1.0, abs=1e-3)


def test_a_link_without_capacitance_falls_with_the_power_drawn() -> None:
    run = faulty("capacitor_loss", size=0.9)
    power = (run["motor_voltage"] + 1.35) * (run["motor_current"] - 0.32)
    lost = given(run) - given(nominal())
    busy = power[ONSET + 20 :] > np.quantile(power[ONSET + 20 :], 0.75)
    idle = power[ONSET + 20 :] < np.quantile(power[ONSET + 20 :], 0.25)
    assert np.mean(lost[busy]) > 0.2
    assert np.abs(np.mean(lost[idle])) < 0.1
    assert ratio("capacitor_loss", "load_position") < ratio("capacitor_loss", "load_position",
                                                            size=0.5)  # fmt: skip


def test_a_capacitor_that_runs_away_shows_nothing_until_it_breaks_down() -> None:
    run = faulty("capacitor_runaway", growth_s=2.0)
    before, after = slice(ONSET, ONSET + 195), slice(ONSET + 210, None)
    np.testing.assert_allclose(run["motor_current"][before], nominal()["motor_current"][before])
    assert np.std(run["motor_voltage"][after]) < 0.1 * np.std(nominal()["motor_voltage"][after])


def test_a_broken_gate_takes_from_one_way_alone() -> None:
    run = faulty("transistor_breakdown", size=0.5)
    forth = run["commanded_voltage"][ONSET + 20 :] > 2.0
    back = run["commanded_voltage"][ONSET + 20 :] < -2.0
    assert np.mean(given(run)[forth]) > np.mean(given(nominal())[forth]) + 1.0
    assert np.mean(given(run)[back]) == pytest.approx(np.mean(given(nominal())[back]), abs=0.3)


def test_chafed_leads_pass_a_current_that_the_motor_does_not_get() -> None:
    run = faulty("lead_leak", size=0.1)
    late = slice(ONSET + 20, None)
    voltage = run["motor_voltage"][late] + 1.35
    back_emf = run["motor_speed"][late] * 0.08929
    moved = (voltage - back_emf) / 2.95
    slope = np.linalg.lstsq(
        np.column_stack((voltage, moved)), run["motor_current"][late] - 0.32, rcond=None
    )[0][0]
    assert slope == pytest.approx(0.1, abs=0.02)


def test_the_papers_feature_table_and_scenarios_name_faults_of_the_catalogue() -> None:
    table = yaml.safe_load((ROOT / "config" / "feature_table_paper.yaml").read_text())
    assert set(table["faults"]) <= set(CATALOGUE)
    assert {row.fault for row in table4.ROWS if row.fault} <= set(CATALOGUE)
    counts = [row.scenarios for row in table4.ROWS]
    assert (sum(counts), counts[0]) == (320, 134)  # as the paper has it


def test_accelerometer_faults_persist_at_standstill() -> None:
    still = {"motion": {"kind": "hold"}, "sensors": {}, "duration_s": 3.0}
    for number, size in ((1, 8.0), (2, 12.0)):
        axes = slice(3 * number - 3, 3 * number)
        noisy = vibration(records(**still, **fault(f"accelerometer_{number}_fault", 0.0)))
        np.testing.assert_allclose(np.std(noisy[:, axes], axis=0), size, rtol=0.05)
        dead = vibration(records(**still, **fault(f"accelerometer_{number}_fault", 0.0, size=0.0)))
        assert np.all(dead[:, axes] == 0.0)
        assert np.all(np.std(np.delete(dead, np.arange(6)[axes], axis=1), axis=0) > 0.1)


def test_faults_outside_the_catalogue_move_what_they_act_on() -> None:
    """On the 8 kN actuator, in the last second of eight: without, and with each of them."""
    sine = {"kind": "sine", "amplitude_m": 0.02, "frequency_hz": 0.25, "centre_m": 0.07}
    whole: dict[str, Any] = {"machine": "ema", "duration_s": DURATION_S, "motion": sine}

    def last(**options: Any) -> dict[str, Array]:
        return {name: row[-200:] for name, row in scans(records(**whole, **options)).items()}

    free = last()
    loaded = last(**fault("second_load", 4.0, size=800.0))
    drawn = loaded["motor_current"] - free["motor_current"]
    assert np.mean(drawn) == pytest.approx(800.0 / 414.0, rel=0.05)  # N over N/A
    assert abs(np.mean(loaded["load_force"] - free["load_force"])) < 40.0
    slips = last(**fault("slipping_gear", 4.0, size=0.1))
    went = {n: np.ptp(slips[n]) / np.ptp(free[n]) for n in ("actuator_position", "load_position")}
    assert went["actuator_position"] / went["load_position"] == pytest.approx(1.1, rel=0.01)
    behind = {
        size: np.abs(run["commanded_position"] - run["actuator_position"]).mean()
        for size in (1.0, 0.3)
        for run in [last(**fault("controller_gain", 4.0, size=size))]
    }
    assert behind[0.3] > 1.5 * behind[1.0]
