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

"""``flea model``: every view, as text and JSON, and what it refuses."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from support.places import WING

from flea_diag.configuration.calibrations import learned, load_calibration
from flea_diag.configuration.description import compiled_relations
from flea_diag.configuration.files import load_yaml
from flea_diag.configuration.knowledge import relations
from flea_diag.configuration.stand import load_stand
from flea_diag.tools.main import main
from flea_diag.tools.model import views as tool

ONE = ["--fault", "jam", "--fault", "winding_short"]


def shown(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    assert main(["model", *arguments]) == 0
    return capsys.readouterr().out


def refused(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    assert main(["model", *arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("flea: ")
    assert captured.err.count("\n") == 1
    return captured.err


@pytest.mark.parametrize("stand", ["flea", "wing"])
@pytest.mark.parametrize("view", tool.VIEWS)
def test_every_view_of_every_actuator(
    capsys: pytest.CaptureFixture[str], view: str, stand: str
) -> None:
    text = shown(capsys, view, "--stand", stand, *ONE)
    assert len(text.splitlines()) > 3
    content = json.loads(shown(capsys, view, "--stand", stand, *ONE, "--json"))
    assert content


def test_show_says_the_causality(capsys: pytest.CaptureFixture[str]) -> None:
    text = shown(capsys, "show")
    assert "supply -> terminals" in text
    assert "I rotor (integral) sets the flow on rotor" in text
    assert "winding_inductance = 0.002 H  (assumption" in text


def test_equations_say_where_the_stops_are_or_what_follows_where_nobody_says(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    text = shown(capsys, "equations")
    assert "Travel: 0 to 0.1 m at nut; contact with a stop voids parity_mechanical" in text
    content = yaml.safe_load(WING.read_text(encoding="utf-8"))
    del content["travel"]
    (tmp_path / "actuator.yaml").write_text(yaml.safe_dump(content), encoding="utf-8")
    text = shown(capsys, "equations", "--actuator", str(tmp_path / "actuator.yaml"))
    assert "Travel: not stated, taken from the range of actuator_position" in text
    assert "a run into a stop is taken for a fault" in text


def test_equations_of_the_motor(capsys: pytest.CaptureFixture[str]) -> None:
    text = shown(capsys, "equations", "--model", "driven")
    warm = "R*(1 + alpha*(T_w - T_0))"
    assert f"  d i/dt = (motor_voltage - V_0 - {warm}*i - Km*omega)/L" in text
    assert "Model stand" not in text


def test_relations_that_run_have_their_calibrated_numbers(
    capsys: pytest.CaptureFixture[str],
) -> None:
    calibration = "calibration_simulated_stand.yaml"
    content = json.loads(shown(capsys, "equations", "--calibration", calibration, "--json"))
    learned = load_calibration(calibration)
    run, numbers = content["relations"], content["base_parameters"]
    assert run["parity_speed"] == "motor_speed*encoder_m_per_rad - d_actuator_position"
    row = numbers["force_constant_n_per_a"]
    assert row["value"] == learned.parameters.force_constant_n_per_a
    assert row["sigma"] == learned.sigmas["force_constant_n_per_a"]
    assert row["definition"] == "torque_constant/screw_ratio"
    assert "an assumption" in numbers["stribeck_speed_m_s"]["not_identified"]
    assert set(numbers) <= {field.name for field in fields(learned.parameters)}


@pytest.mark.parametrize("stand", ["flea", "joint", "cranfield"])
def test_what_is_printed_is_what_runs(capsys: pytest.CaptureFixture[str], stand: str) -> None:
    """The printed lines, with the printed numbers, give what the compiled functions give."""
    calibration = learned(load_stand(stand))
    given = ("--stand", stand, "--calibration", str(load_stand(stand).calibration))
    content = json.loads(shown(capsys, "equations", *given, "--json"))
    known = relations(load_stand(stand), calibration)
    random = np.random.default_rng(4)
    x = {name: float(random.normal()) for name in known.signals}
    numbers = {name: row["value"] for name, row in content["base_parameters"].items()}
    scope = {**numbers, **x, "fabs": abs}
    run = known.functions["relations"](calibration.parameters, [x[n] for n in known.signals])
    assert list(content["relations"]) == list(known.names)
    for printed, value in zip(content["relations"].values(), run, strict=True):
        found = eval(printed, {"__builtins__": {}}, scope)
        assert found == pytest.approx(value, rel=1e-12, abs=1e-12)


def test_relations_without_a_calibration_have_the_description_s_numbers(
    capsys: pytest.CaptureFixture[str],
) -> None:
    content = json.loads(shown(capsys, "equations", "--json"))
    assert list(content["relations"]) == list(compiled_relations("actuator.yaml").names)
    text = shown(capsys, "equations", "--sensors", "motor_current,actuator_position,load_force")
    assert "  reflected_mass_kg = 130.02 kg  rotor_inertia/screw_ratio**2\n" in text
    assert "parity_electrical = not closed: " in text
    assert "Relations that run, in base parameters:\n  parity_mechanical = " in text


def test_a_calibration_of_another_actuator_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    calibration = ("--calibration", "calibration_simulated_stand.yaml")
    said = refused(capsys, "equations", "--actuator", str(WING), *calibration)
    assert "made for actuator 'flea' (sha256 " in said
    assert "stands/wing/actuator.yaml describes 'wing' (sha256 " in said
    assert ": give stand flea, or calibrate again with flea calibrate --actuator " in said


def test_base_parameters_are_in_the_units_of_the_description(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """By names that end in units of a line: a joint has torques, angles and inertias."""
    turning = {
        "force_constant_n_per_a": "N*m/A",
        "reflected_mass_kg": "kg*m^2",
        "coulomb_friction_n": "N*m",
        "viscous_friction_n_s_per_m": "N*m*s/rad",
        "stribeck_speed_m_s": "rad/s",
        "back_emf_v_s_per_m": "V*s/rad",
        "encoder_m_per_rad": "1",
    }
    straight = {
        "force_constant_n_per_a": "N/A",
        "reflected_mass_kg": "kg",
        "coulomb_friction_n": "N",
        "viscous_friction_n_s_per_m": "N*s/m",
        "stribeck_speed_m_s": "m/s",
        "back_emf_v_s_per_m": "V*s/m",
        "encoder_m_per_rad": "m/rad",
    }
    for stand, wanted in (("joint", turning), ("flea", straight), ("wing", straight)):
        content = json.loads(shown(capsys, "equations", "--stand", stand, "--json"))
        numbers = content["base_parameters"]
        assert {name: numbers[name]["unit"] for name in wanted} == wanted


def test_signatures_at_a_rate_and_in_a_quadrant(capsys: pytest.CaptureFixture[str]) -> None:
    content = json.loads(
        shown(capsys, "signatures", *ONE, "--rate", "100", "--quadrant", "i-,w-", "--json")
    )
    (rows,) = content.values()
    assert rows["jam"]["motor_speed"]["symbols"] == "++"
    assert rows["jam"]["parity_mechanical_dn"]["symbols"][0] == "+"
    assert "screw_coulomb_friction+" in rows["jam"]["motor_speed"]["path"]


def test_hypotheses_for_a_deviation(capsys: pytest.CaptureFixture[str]) -> None:
    text = shown(capsys, "tcg", "--from", "motor_speed-")
    assert "screw_coulomb_friction+  (order 1:" in text
    assert "back_emf_constant-" not in text
    assert "back_emf_constant-" in shown(capsys, "tcg", "--from", "motor_speed-", "--complete")


def test_diagnosability_says_what_no_feature_table_can_split(
    capsys: pytest.CaptureFixture[str],
) -> None:
    content = json.loads(shown(capsys, "diagnosability", "--json"))["never_split_by_features"]
    (paper,) = (groups for title, groups in content.items() if "Table 3" in title)
    assert sorted(paper) == [
        ["accelerometer_2_fault", "ball_nut_friction", "jam", "spall"],
        ["backlash", "rotor_eccentricity"],
    ]
    (learned,) = (groups for title, groups in content.items() if "Table 3" not in title)
    # Faults that act on no accelerometer are alike; every other one has a row of its own.
    assert all("spall" not in group and "jam" not in group for group in learned)
    assert any({"motor_current_bias", "motor_voltage_bias"} <= set(group) for group in learned)
    text = shown(capsys, "diagnosability", "--fault", "jam", "--fault", "ball_nut_friction")
    assert "none, all pairs are separable" in text
    assert "{ball_nut_friction, jam}" in text.split("Table 3:")[1]


def test_diagnosability_names_what_would_help(capsys: pytest.CaptureFixture[str]) -> None:
    friction = ["--fault", "jam", "--fault", "spall"]
    content = json.loads(shown(capsys, "diagnosability", *friction, "--json"))
    assert content["ambiguity"]["jam"] == ["jam", "spall"]
    assert content["helpful"] == ["jam from spall: accelerometers (fault-feature table)"]
    fewer = ["--sensors", "motor_current,motor_voltage"]
    text = shown(capsys, "diagnosability", *friction, *fewer)
    assert "Sensors: motor_voltage, motor_current\n" in text


def test_pictures(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert shown(capsys, "show", "--dot").startswith('digraph "flea" {')
    assert shown(capsys, "tcg", "--dot").startswith("digraph tcg {")
    if shutil.which("dot") is None:
        pytest.skip("Graphviz is not installed: no SVG can be drawn")
    target = tmp_path / "graph.svg"
    shown(capsys, "show", "--svg", str(target))
    assert "<svg" in target.read_text()


def _dangling(plain: dict[str, Any]) -> None:
    plain["bonds"].append("nut -> nowhere")


def _unconnected(plain: dict[str, Any]) -> None:
    plain["bonds"].remove("shaft -> rotor")


def _wrong_unit(plain: dict[str, Any]) -> None:
    plain["parameters"]["winding_resistance"]["unit"] = "N"


def _negative(plain: dict[str, Any]) -> None:
    plain["parameters"]["rotor_inertia"]["value"] = -1e-5


def _second_supply(plain: dict[str, Any]) -> None:
    plain["elements"]["supply2"] = {"type": "Se", "signal": "commanded_voltage"}
    plain["bonds"].append("supply2 -> terminals")


def _rigid_mass(plain: dict[str, Any]) -> None:
    plain["elements"]["carriage"] = {
        "type": "I",
        "state": "v_c",
        "parameters": {"inertia": "load_mass"},
    }
    plain["bonds"].append("nut -> carriage")


def _cable_and_leak(plain: dict[str, Any]) -> None:
    resistor = {"type": "R", "parameters": {"resistance": "winding_resistance"}}
    plain["elements"] |= {"cable_loss": dict(resistor), "leak": dict(resistor)}
    plain["junctions"]["cable"] = {"type": "1", "domain": "electrical"}
    plain["bonds"].remove("supply -> terminals")
    plain["bonds"] += ["supply -> cable", "cable -> cable_loss", "cable -> terminals"]
    plain["bonds"].append("terminals -> leak")


REFUSED = {
    "dangling bond": (_dangling, "bond nut -> nowhere is dangling", "define it or remove"),
    "unconnected": (_unconnected, "I 'rotor' has 0 bonds", "connect it"),
    "wrong unit": (_wrong_unit, "'winding_resistance' has unit 'N'", "convert the value"),
    "negative inertia": (_negative, "'rotor_inertia' = -1e-05 kg*m^2", "correct its value"),
    "two supplies": (_second_supply, "causal conflict at 'supply2'", "remove one or join"),
    "dependent mass": (_rigid_mass, "I 'carriage' has derivative causality", "merge it with"),
    "algebraic loop": (_cable_and_leak, "algebraic loop", "put a store"),
}
DRAWN = {"two supplies": "supply2", "dependent mass": "carriage", "algebraic loop": "cable_loss"}


@pytest.mark.parametrize("case", REFUSED)
def test_a_wrong_description_is_refused_by_every_view_with_element_and_remedy(
    case: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    edit, element, remedy = REFUSED[case]
    described = wrong(edit, tmp_path)
    # What has a graph is shown, see below.
    for view in tuple(tool.VIEWS)[case in DRAWN :]:
        said = refused(capsys, view, "--actuator", described)
        assert element in said, view
        assert remedy in said, view


@pytest.mark.parametrize("case", DRAWN)
def test_what_is_wrong_with_the_causality_is_shown_and_drawn_all_the_same(
    case: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    described = wrong(REFUSED[case][0], tmp_path)
    assert main(["model", "show", "--dot", "--actuator", described]) == 2
    red = [line for line in capsys.readouterr().out.splitlines() if "color=red" in line]
    assert any(f'"{DRAWN[case]}"' in line for line in red)
    assert main(["model", "show", "--json", "--actuator", described]) == 2
    assert json.loads(capsys.readouterr().out)["sound"] is False


def wrong(edit: Callable[[dict[str, Any]], None], folder: Path) -> str:
    """Path of the shipped description with one mistake in it."""
    plain = load_yaml("actuator.yaml")
    edit(plain)
    path = folder / "wrong.yaml"
    path.write_text(yaml.safe_dump(plain, sort_keys=False))
    return str(path)


def test_svg_without_graphviz_says_what_to_do(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    said = refused(capsys, "show", "--svg", str(tmp_path / "graph.svg"))
    assert "Graphviz is not installed" in said
    assert "--dot" in said


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["signatures", "--rate", "nan"], "--rate nan"),
        (["signatures", "--rate", "-5"], "--rate -5"),
        (["signatures", "--quadrant", "north"], "--quadrant north"),
        (["signatures", "--fault", "gremlin"], "--fault gremlin"),
        (["equations", "--model", "ideal"], "'ideal'"),
        (["show", "--sensors", "motor_current,nose"], "'nose'"),
        (["show", "--actuator", "nowhere.yaml"], "nowhere.yaml"),
        (["show", "--actuator", "faults.yaml"], "faults.yaml"),
        (["tcg", "--from", "motor_speed"], "--from motor_speed"),
        (["tcg", "--from", "+"], "--from +"),
        (["equations", "--dot"], "not to equations"),
    ],
)
def test_bad_arguments(
    capsys: pytest.CaptureFixture[str], arguments: list[str], words: str
) -> None:
    assert words in refused(capsys, *arguments)


def test_unwritable_picture_is_one_line(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    if shutil.which("dot") is None:
        pytest.skip("Graphviz is not installed: no SVG can be drawn")
    assert "cannot be written" in refused(capsys, "show", "--svg", str(tmp_path / "no" / "g.svg"))
