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

"""``flea stand check`` on a simulated joint: channels, faults, one more sensor, and hours."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.places import CONFIG

from flea_diag.configuration.calibrations import load_calibration
from flea_diag.configuration.stand import load_stand
from flea_diag.tools.calibrate.calibrate import write_calibration
from flea_diag.tools.main import main
from flea_diag.tools.stand_check.page_text import as_mapping
from flea_diag.tools.stand_check.recorded_motion import recorded_motions
from flea_diag.tools.stand_check.stand_page import stand_page
from flea_diag.wire.bags.bag import read_bag
from flea_diag.wire.records import Scan

JOINT = CONFIG / "stands" / "joint"
SECONDS = 20.0


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A healthy joint that follows a sine."""
    folder = tmp_path_factory.mktemp("check") / "healthy"
    given = ["--machine", "joint", "--unit-seed", "301", "--seed", "3011", "-o", str(folder)]
    assert main(["simulate", "nominal", "--duration", str(SECONDS), *given]) == 0
    return folder


def columns(bag: Path) -> dict[str, Any]:
    scans = [record for _, record in read_bag(bag, (Scan,)) if isinstance(record, Scan)]
    return dict(zip(scans[0].channels, np.array([s.values for s in scans]).T, strict=True))


def page(stand: Path, bag: Path) -> dict[str, Any]:
    """What ``--json`` prints."""
    known = load_stand(stand)
    return as_mapping(stand_page(known, list(recorded_motions(bag, known))))


@pytest.fixture(scope="module")
def calibrated(bag: Path) -> dict[str, Any]:
    """The page of the shipped stand."""
    return page(JOINT, bag)


@pytest.fixture(scope="module")
def described(bag: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """The same before a calibration."""
    return page(uncalibrated(tmp_path_factory.mktemp("stand")), bag)


def uncalibrated(folder: Path) -> Path:
    made = folder / "elbow"
    shutil.copytree(JOINT, made, ignore=shutil.ignore_patterns("calibration.yaml"))
    return made


def test_channels_are_as_recorded(bag: Path, calibrated: dict[str, Any]) -> None:
    found = {row["name"]: row for row in calibrated["channels"]}
    for name, values in columns(bag).items():
        assert (found[name]["lowest"], found[name]["highest"]) == (values.min(), values.max())
        assert (found[name]["missing"], found[name]["problem"]) == (0.0, "")
    # config/machines/joint.yaml: the hall sensor's noise and its step of 5 mA; a little is ripple.
    own = np.hypot(0.03, 0.005 / np.sqrt(12.0))
    assert 0.95 * own < found["motor_current"]["noise"] < 1.25 * own
    assert found["motor_voltage"]["problem"] == "not recorded"


def test_without_a_calibration_the_description_says_what_is_seen(
    described: dict[str, Any],
) -> None:
    told = described
    assert told["calibrated"] is False
    bounds = {(row["fault"], row["size"]["name"]): row for row in told["bounds"]}
    friction = bounds["gear_friction", "viscous drag"]
    assert {"gear_friction", "jam"} == set(friction["group"])
    assert set(bounds["motor_current_scaling", "scaling share"]["group"]) == {
        "motor_current_scaling",
        "magnet_loss",
    }
    assert {"backlash", "winding_resistance_rise"} == set(told["unseen"])
    assert "actuator_position_bias" in told["alone"]
    (voltage,) = told["sensors"]
    assert voltage["channel"] == "motor_voltage"
    assert any("detects winding_resistance_rise" in words for words in voltage["brings"])
    # The rule of three: 30 h without an alarm for one in ten hours.
    missing = told["promise"]["missing_hours"]
    assert missing == pytest.approx(-np.log(0.05) / 0.1 - SECONDS / 3600.0, rel=1e-9)
    assert told["promise"]["missing_recordings"] == np.ceil(missing * 3600.0 / SECONDS)


COSTS = {
    "load_force": ("jam", "ball_nut_friction"),
    "motor_voltage": ("winding_resistance_rise", "supply_sag"),
}
"""Friction is in the balance of forces, copper and supply are in that of voltages."""


def test_what_missing_sensors_cost_is_said(tmp_path: Path) -> None:
    """An aileron drive, calibrated with all its sensors, is recorded without two of them."""
    wing = load_stand("wing")
    given = ["--machine", "wing", "--unit-seed", "31", "--seed", "20", "-o", str(tmp_path / "bag")]
    assert main(["simulate", "nominal_loaded", "--duration", str(SECONDS), *given]) == 0
    (whole,) = recorded_motions(tmp_path / "bag", wing)
    kept = [k for k, row in enumerate(whole.channels) if row.name not in COSTS]
    channels = tuple(whole.channels[k] for k in kept)
    told = stand_page(wing, [replace(whole, channels=channels, values=whole.values[:, kept])])
    brings = {row.channel: row.brings for row in told.sensors}
    for lacking, faults in COSTS.items():
        for fault in faults:
            assert "in no relation of these channels" in told.unseen[fault]
            assert any(words.startswith(f"detects {fault} from ") for words in brings[lacking])


def test_a_calibration_raises_what_the_noise_alone_would_show(
    described: dict[str, Any], calibrated: dict[str, Any]
) -> None:
    """It knows by how much healthy runs scatter about the model."""
    assert calibrated["calibrated"] is True
    sizes = [
        {(row["fault"], row["size"]["name"]): row["detected_from"] for row in told["bounds"]}
        for told in (described, calibrated)
    ]
    for key in (("jam", "coulomb drag"), ("motor_current_bias", "bias")):
        assert sizes[1][key] > 2.0 * sizes[0][key]


def test_the_page_fits_a_screen_and_names_what_it_rests_on(
    bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Without a law, of which a table of its own says what it sees."""
    folder = tmp_path / "joint"
    shutil.copytree(JOINT, folder)
    path = folder / "calibration.yaml"
    write_calibration(path, replace(load_calibration(path), law=None))
    assert main(["stand", "check", str(folder), str(bag)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) < 60
    assert lines[0].startswith("Stand joint: 1 recordings, 20 s, scans at 100 Hz; with the noise")
    assert any(line.startswith("Recordings: 0.1 false alarms per hour stated") for line in lines)


def test_a_dead_channel_is_named_and_the_status_tells(
    bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = columns(bag)
    rows = "\n".join(
        f"{i},{v / 80.0},{x},21.5"
        for i, v, x in zip(
            table["motor_current"], table["motor_speed"], table["actuator_position"], strict=True
        )
    )
    (tmp_path / "run.csv").write_text(f"effort,velocity,angle,warm\n{rows}\n", encoding="utf-8")
    folder = uncalibrated(tmp_path)
    (folder / "channels.yaml").write_text(
        "schema_version: 1\nrate_hz: 100.0\nchannels:\n"
        "  motor_current: {column: effort, unit: A, range: [-20.0, 20.0]}\n"
        "  motor_speed: {column: velocity, unit: rad/s, scale: 80.0, range: [-400.0, 400.0]}\n"
        "  actuator_position: {column: angle, unit: rad, range: [-0.5, 5.5]}\n"
        "  motor_temperature: {column: warm, unit: degC, range: [-40.0, 150.0]}\n",
        encoding="utf-8",
    )
    assert main(["stand", "check", str(folder), str(tmp_path / "run.csv"), "--json"]) == 1
    told = capsys.readouterr()
    assert "motor_temperature: always 21.5 degC: dead, or recorded at rest" in told.err
    assert json.loads(told.out)["relations"] == ["parity_mechanical", "parity_speed"]


def test_a_recording_that_is_none_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["stand", "check", str(JOINT), str(tmp_path / "nothing.csv")]) == 2
    assert "none of 1 recordings can be used" in capsys.readouterr().err


def test_a_mode_that_no_recording_shows_is_said_in_a_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = tmp_path / "run"
    given = ["--machine", "axis", "--duration", "10", "--unit-seed", "301", "-o", str(run)]
    assert main(["simulate", "nominal_trapezoid", *given]) == 0
    capsys.readouterr()
    assert main(["stand", "check", "axis", str(run)]) == 0
    told = capsys.readouterr().err.splitlines()
    assert [line for line in told if "mode" in line] == [
        "flea: mode braked is never seen: brake_engaged is nowhere above 0.5"
    ]
