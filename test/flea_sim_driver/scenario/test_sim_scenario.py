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

"""Scenarios: what is impossible is refused by name, value and limit before anything moves."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from support import examples
from support.places import ROOT
from support.stand_runs import scenario

from flea_diag.errors import ConfigurationError
from flea_sim_driver.machine.library import find_machine
from flea_sim_driver.scenario.flight import read_flight
from flea_sim_driver.scenario.library import find_scenario, scenario_names
from flea_sim_driver.scenario.profile import commanded, peaks
from flea_sim_driver.scenario.scenario_file import (
    load_scenario,
    scenario_from_mapping,
    scenario_to_mapping,
)
from flea_sim_driver.scenario.table4 import CampaignRow, Shared, draw, table4
from flea_sim_driver.stand import SimulatedStand

LIMITS = find_machine("flea").limits
REFUSED: dict[str, tuple[dict[str, Any], tuple[str, ...]]] = {
    "jerk": (
        {"motion": {"kind": "triangle", "amplitude_m": 0.006, "frequency_hz": 5.0}},
        ("m/s^3", "5000"),
    ),
    "resonance spread": (
        {"structure": {"resonance": 0.8}},
        ("structure", "resonance", "0.8", "0.5"),
    ),
    "unknown key": ({"moton": {}}, ("moton", "known are")),
    "unknown section key": ({"motion": {"ampl": 1.0}}, ("motion", "ampl")),
    "unknown fault": ({"faults": [{"fault": "rust"}]}, ("rust", "jam")),
    "onset after the end": (
        {"faults": [{"fault": "jam", "onset_s": 30.0}], "duration_s": 30.0},
        ("jam", "30.0", "end"),
    ),
    "size": (
        {"faults": [{"fault": "winding_short", "size": 1.5}]},
        ("winding_short", "1.5", "0.9"),
    ),
    "place": ({"faults": [{"fault": "load_force_bias", "where": "plant"}]}, ("where", "daq")),
    "sensor on a unit": ({"faults": [{"fault": "load_force_bias", "unit": "X"}]}, ("unit", "X")),
    "idle unit": ({"faults": [{"fault": "jam", "unit": "X"}]}, ("jam", "X", "never in use")),
    "half intermittent": ({"faults": [{"fault": "jam", "on_s": 1.0}]}, ("on_s", "off_s")),
    "stroke": ({"motion": {"amplitude_m": 0.05, "centre_m": 0.03}}, ("end stops", "0.08")),
    "speed": ({"motion": {"amplitude_m": 0.04, "frequency_hz": 2.0}}, ("0.503", "0.2 m/s")),
    "load": ({"load": {"constant_n": 400.0}}, ("constant_n", "400.0", "311.3")),
    "load together": ({"load": {"constant_n": 300.0, "amplitude_n": 50.0}}, ("350.0", "311.4")),
    "nan": ({"duration_s": float("nan")}, ("duration_s", "nan")),
    "text": ({"duration_s": "long"}, ("duration_s", "long")),
    "ramps": (
        {"motion": {"kind": "trapezoid", "frequency_hz": 0.5, "rise_s": 1.5}},
        ("rise_s", "1.5", "2.000"),
    ),
    "block": ({"sensors": {"vibration_rate_hz": 20001.0}}, ("vibration_rate_hz", "10 Hz")),
    "channel": ({"sensors": {"defective": "mood"}}, ("mood", "motor_voltage")),
    "switch": ({"switch": {"at_s": 31.0}, "duration_s": 30.0}, ("at_s", "31.0", "30.0")),
    "faults": ({"faults": {"fault": "jam"}}, ("faults", "list")),
    "flight without file": ({"motion": {"kind": "flight"}}, ("motion.file",)),
}


@pytest.mark.parametrize("name", REFUSED)
def test_the_impossible_is_refused_by_name_value_and_limit(name: str) -> None:
    values, words = REFUSED[name]
    with pytest.raises(ConfigurationError) as refused:
        scenario_from_mapping(values, "demo.yaml")
    text = str(refused.value)
    assert text.startswith("demo.yaml")
    assert "\n" not in text
    assert all(word in text for word in words), text


@given(
    st.dictionaries(
        st.sampled_from(["motion", "load", "faults", "seed", "duration_s", "name", "switch", "x"]),
        st.recursive(
            st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
            lambda inner: (
                st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3)
            ),
            max_leaves=6,
        ),
    )
)
@settings(max_examples=examples(150), deadline=None)
def test_any_mapping_is_a_scenario_or_one_clear_refusal(values: dict[str, Any]) -> None:
    try:
        made = scenario_from_mapping(values, "fuzz")
    except ConfigurationError as error:
        assert str(error).startswith("fuzz")  # noqa: PT017 - either outcome is right
    else:
        assert 0.1 <= made.run.duration_s <= 86400.0


@pytest.mark.parametrize(
    "content",
    [
        b"[1, 2]",
        b"a: [",
        b"\xff\xfe\x00",
        b"!!python/object/apply:os.getcwd []",
        b"name: " + b"x" * 2**21,
        b"seed: 2020-13-45",
        b"seed: 0x_",
    ],
)
def test_a_bad_file_is_named(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "bad.yaml"
    path.write_bytes(content)
    with pytest.raises(ConfigurationError, match=r"bad\.yaml"):
        load_scenario(path)


def test_a_missing_scenario_lists_what_there_is() -> None:
    with pytest.raises(ConfigurationError, match="jam"):
        find_scenario("jom")


def test_every_scenario_of_the_package_is_accepted() -> None:
    files = {path.stem for path in (ROOT / "config" / "scenarios").glob("*.yaml")}
    assert set(scenario_names()) == files
    for name in files:
        assert find_scenario(name).run.name == name


def test_a_checkout_finds_its_own_scenarios(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("AMENT_PREFIX_PATH", "")
    monkeypatch.setattr("sys.prefix", "/nowhere")
    assert "jam" in scenario_names()


def test_a_scenario_survives_its_file(tmp_path: Path) -> None:
    for number, made in enumerate(table4(3)[::40]):
        path = tmp_path / f"{number}.yaml"
        path.write_text(yaml.safe_dump(scenario_to_mapping(made)))
        assert load_scenario(path) == made


def test_table_4_has_the_papers_rows_and_draws_each_anew() -> None:
    made = table4(1)
    counts: dict[str, int] = {}
    for each in made:
        name = each.faults[0].fault if each.faults else "nominal"
        counts[name] = counts.get(name, 0) + 1
    assert len(made) == 320
    assert counts["nominal"] == 134
    assert counts["actuator_position_dead"] == 21
    assert [count for name, count in counts.items() if count == 15] == [15] * 11
    assert len({each.run.seed for each in made}) == 320
    assert {each.motion.kind for each in made} == {"sine", "trapezoid", "triangle", "sweep"}
    assert table4(1) == made
    assert table4(2) != made


def test_ramps_have_neither_jumps_nor_kinks() -> None:
    made = scenario(motion={"kind": "trapezoid", "amplitude_m": 0.02, "frequency_hz": 0.1})
    time = np.arange(0.0, 10.0, 1e-3)
    position, _ = commanded(made, time)
    assert position.min() == pytest.approx(0.025)
    assert position.max() == pytest.approx(0.065)
    assert np.abs(np.diff(position, 2)).max() / 1e-6 < 0.3  # m/s^2; a kink would be 40


def test_a_sweep_ends_at_its_end_frequency() -> None:
    made = scenario(
        duration_s=20.0,
        motion={"kind": "sweep", "amplitude_m": 0.01, "frequency_hz": 0.2, "end_frequency_hz": 1.0},
    )
    position, _ = commanded(made, np.arange(0.0, 20.0, 1e-3))
    crossings = np.flatnonzero(np.diff(np.sign(position - 0.045)) != 0) * 1e-3
    assert 0.5 / (crossings[1] - crossings[0]) == pytest.approx(0.25, abs=0.06)
    assert 0.5 / (crossings[-1] - crossings[-2]) == pytest.approx(1.0, abs=0.05)
    assert len(crossings) == pytest.approx(2 * 20 * 0.6, abs=1)  # twice the mean frequency


FLIGHT = "time_s,position_m,load_N\n"
BAD_FLIGHTS = {
    "gap": (FLIGHT + "0,0.05,0\n0.1,0.05,0\n2.1,0.05,0\n", ("row 2", "gap", "0.5 s")),
    "backwards": (FLIGHT + "0,0.05,0\n0.2,0.05,0\n0.1,0.05,0\n", ("time step", "rise")),
    "stroke": (FLIGHT + "0,0.09,0\n0.2,0.105,0\n", ("position_m", "0.105", "0.1 m")),
    "speed": (FLIGHT + "0,0.02,0\n0.1,0.05,0\n", ("speed", "0.3", "0.12")),
    "load": (FLIGHT + "0,0.05,0\n0.1,0.05,-500\n", ("load_N", "-500", "311.4")),
    "columns": ("t,x\n0,0\n", ("columns", "position_m")),
    "not finite": (FLIGHT + "0,0.05,0\n0.1,nan,0\n", ("line 3", "finite")),
    "short": (FLIGHT + "0,0.05,0\n", ("1 rows", "2")),
}


@pytest.mark.parametrize("name", BAD_FLIGHTS)
def test_a_flight_that_cannot_be_followed_is_refused(tmp_path: Path, name: str) -> None:
    text, words = BAD_FLIGHTS[name]
    (tmp_path / "flight.csv").write_text(text)
    with pytest.raises(ConfigurationError) as refused:
        scenario_from_mapping(
            {"motion": {"kind": "flight", "file": "flight.csv"}}, "s.yaml", tmp_path
        )
    assert all(word in str(refused.value) for word in (*words, "flight.csv")), refused.value


def test_a_flight_is_scaled_where_asked(tmp_path: Path) -> None:
    rows = [f"{k / 10},{0.3 + 0.2 * np.sin(k / 50)},{900 * np.cos(k / 50)}" for k in range(400)]
    (tmp_path / "flight.csv").write_text(FLIGHT + "\n".join(rows) + "\n")
    motion = {"kind": "flight", "file": "flight.csv", "fit": True}
    made = scenario_from_mapping({"motion": motion}, "s.yaml", tmp_path)
    position, load = commanded(made, np.arange(0.0, 39.0, 0.1))
    assert 0.0 <= position.min() < position.max() <= 0.1
    assert np.ptp(position) == pytest.approx(0.09, rel=0.01)
    assert np.abs(load).max() == pytest.approx(311.4, rel=1e-3)


@pytest.mark.parametrize("kind", ["sine", "triangle", "trapezoid", "sweep"])
def test_a_command_starts_from_rest_and_its_peaks_are_those_told(kind: str) -> None:
    motion = {"kind": kind, "amplitude_m": 0.02, "frequency_hz": 0.6, "end_frequency_hz": 0.6,
              "rise_s": 0.4}  # fmt: skip
    made = scenario(motion=motion, load={"constant_n": 200.0}, duration_s=20.0)
    step = 1e-4
    time = np.arange(0.0, 8.0, step)
    position, load = commanded(made, time)
    speed, acceleration = np.diff(position) / step, np.diff(position, 2) / step**2
    assert abs(speed[0]) < 1e-4
    assert abs(acceleration[0]) < 0.05
    assert load[0] == 0.0
    assert load[time > 1.0].min() == 200.0
    swung = time[:-3] > 2.0
    told = peaks(made.motion)
    reached = (np.diff(position, n) / step**n for n in (1, 2, 3))
    for value, limit in zip(
        reached, (told.speed_m_s, told.acceleration_m_s2, told.jerk_m_s3), strict=True
    ):
        assert np.abs(value[: len(swung)][swung]).max() == pytest.approx(limit, rel=0.03)


def test_a_flight_has_no_jumps_in_speed_and_passes_through_its_rows(tmp_path: Path) -> None:
    rows = [(0.1 * k, 0.05 + 0.004 * np.sin(0.3 * k), 10.0 * k % 70.0) for k in range(100)]
    path = tmp_path / "flight.csv"
    path.write_text("time_s,position_m,load_N\n" + "\n".join(f"{a},{b},{c}" for a, b, c in rows))
    flight = read_flight(path, LIMITS)
    position, _ = flight.at(np.array([row[0] for row in rows]))
    np.testing.assert_allclose(position, [row[1] for row in rows], atol=1e-12)
    fine = np.arange(0.0, 9.8, 1e-4)
    speed = np.diff(flight.at(fine)[0]) / 1e-4
    assert np.abs(np.diff(speed)).max() < 2e-4  # straight lines between rows jump by 4e-3
    assert flight.at(np.array([1e3]))[0] == pytest.approx(rows[-1][1])


def test_a_flight_that_turns_too_hard_is_refused_with_its_row(tmp_path: Path) -> None:
    path = tmp_path / "flight.csv"
    rows = [f"{0.02 * k:.2f},{0.05 + 0.002 * (-1) ** k},0" for k in range(5)]
    path.write_text("time_s,position_m,load_N\n" + "\n".join(rows))
    with pytest.raises(ConfigurationError, match=r"speed in m/s = 0\.2"):
        read_flight(path, LIMITS)
    rows = [f"{0.04 * k:.2f},{0.05 + 0.002 * (-1) ** k},0" for k in range(5)]
    path.write_text("time_s,position_m,load_N\n" + "\n".join(rows))
    with pytest.raises(ConfigurationError, match=r"row \d.*acceleration in m/s\^2 = .*3\.0"):
        read_flight(path, LIMITS)


def test_a_ladder_takes_each_size_with_every_motion() -> None:
    row = CampaignRow("Jam", "jam", 12, sizes=(0.1, 0.2, 0.4), switched=True)
    made = tuple(draw((row,), 3, Shared(20.0, 9.0, 11.0, {"unit_spread": 0.5})))
    pairs = {(scenario.motion.kind, scenario.faults[0].size) for _, scenario in made}
    assert len(pairs) == 12
    assert all(9.0 <= scenario.switch.at_s <= 11.0 for _, scenario in made)
    assert {scenario.run.unit_spread for _, scenario in made} == {0.5}


def test_a_healthy_unit_can_take_over() -> None:
    row = CampaignRow("Healthy", "", 4, switched=True, warmer_k=8.0)
    made = [scenario for _, scenario in draw((row,), 3, Shared(20.0, 9.0, 11.0))]
    assert all(9.0 <= each.switch.at_s <= 11.0 and not each.faults for each in made)
    assert {(each.switch.to, each.switch.warmer_k) for each in made} == {("X", 8.0)}


def test_the_spread_between_units_can_be_stated() -> None:
    wide = scenario_from_mapping({"spread": {"viscous_friction_n_s_m": 0.6}}, "test")
    stands = [
        SimulatedStand(replace(wide, run=replace(wide.run, seed=seed))) for seed in range(200)
    ]
    shares = np.array([s.units["Y"].viscous_friction_n_s_m for s in stands]) / 412.0
    # Normal, cut at two standard deviations and at a fifth from below: 0.6 becomes some 0.5.
    assert 0.40 < shares.std() < 0.60
    assert shares.min() >= 0.2
    with pytest.raises(ConfigurationError, match=r"spread: unknown parameter 'colour'"):
        scenario_from_mapping({"spread": {"colour": 0.1}}, "test")


def test_small_sizes_are_drawn_as_finely_as_large_ones() -> None:
    row = CampaignRow("Backlash", "backlash", 40, 0.0003, 0.001)
    sizes = [scenario.faults[0].size or 0.0 for _, scenario in draw((row,), seed=1)]
    assert len(set(sizes)) > 30
    assert min(sizes) >= 0.0003
    assert max(sizes) <= 0.001


def test_the_largest_loads_are_not_rounded_beyond_what_the_stand_can_push() -> None:
    loads = [abs(s.load.constant_n) for _, s in draw((CampaignRow("Nominal", "", 48),), seed=121)]
    assert max(loads) == pytest.approx(LIMITS.load_n, abs=0.05)
    assert max(loads) <= LIMITS.load_n
