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

"""Ten recordings of other makes: each ends right, or in one line that says what is wrong.

Right is: imported by what ``flea stand new`` proposed, or by that with one line edited, every
channel in SI equals the motion that all ten were made of.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import yaml
from support import in_turn
from support.foreign import arm
from support.foreign.recordings_of_others import (
    Sent,
    csv,
    joint_states,
    npz,
    topics,
    truth,
)

from flea_diag.tools.main import main
from flea_diag.wire.bags.bag import read_bag
from flea_diag.wire.records import Scan

WITH_UNITS = (
    Sent("actuator_position", "ram_position_mm", "mm"),
    Sent("motor_current", "drive_current_A", sign=-1),
    Sent("motor_voltage", "drive_voltage_V", sign=-1),
    Sent("motor_speed", "motor_speed_rpm", "rpm", sign=-1),
    Sent("load_force", "load_cell_lbf", "lbf"),
    Sent("motor_temperature", "motor_temp_F", "degF"),
    Sent("ambient_temperature", "room_temp_F", "degF"),
)
NO_UNITS = (
    Sent("actuator_position", "position", "in"),
    Sent("motor_current", "current", "mA", sign=-1),
    Sent("motor_voltage", "voltage"),
    Sent("motor_speed", "speed", "rpm"),
    Sent("load_force", "force", "lbf", sign=-1),
    Sent("motor_temperature", "motorTemp", "degF"),
)
SHORT = (
    Sent("actuator_position", "x", "mm"),
    Sent("motor_current", "i"),
    Sent("motor_voltage", "u"),
    Sent("load_force", "load", "kgf", sign=-1),
)
FEW = (
    Sent("actuator_position", "actuator stroke [in]", "in", sign=-1),
    Sent("motor_current", "Motor Current [mA]", "mA"),
    Sent("load_force", "Thrust [kN]", "kN"),
)
PLC = (
    Sent("actuator_position", "/plc/ram_position", "mm", sign=-1),
    Sent("load_position", "/plc/load_position", "in"),
    Sent("motor_current", "/plc/motor_current", "mA", sign=-1),
    Sent("motor_voltage", "/plc/motor_voltage"),
    Sent("commanded_voltage", "/plc/voltage_command", sign=-1),
    Sent("motor_speed", "/plc/motor_speed", "deg/s", sign=-1),
    Sent("load_force", "/plc/load_cell", "lbf"),
    Sent("motor_temperature", "/motor/temperature", "degF", every=50),
    Sent("nut_temperature", "/nut/temperature", "K", every=50),
)
STATES = (
    Sent("actuator_position", "position", "mm"),
    Sent("motor_speed", "velocity", "rpm"),
    Sent("motor_current", "effort", "mA", sign=-1),
)


@dataclass(frozen=True)
class Case:
    """How to make it; what is in it; the line to edit; why it is refused; what is said."""

    make: Callable[[Path], Path]
    sent: tuple[Sent, ...]
    edit: tuple[str, str] = ("", "")
    every: int = 1
    refused: str = ""
    said: str = ""


def bag_of(sent: tuple[Sent, ...], slow: int = 0) -> Callable[[Path], Path]:
    return lambda folder: arm.write_ros2(folder / "run", topics(sent, slow))


CASES = {
    "units in the names, three signs turned": Case(
        lambda folder: csv(folder / "run.csv", WITH_UNITS), WITH_UNITS
    ),
    "no units in the names, semicolons": Case(
        lambda folder: csv(folder / "run.csv", NO_UNITS, ";"), NO_UNITS
    ),
    "letters for names, 50 Hz, arrays, milliseconds": Case(
        lambda folder: npz(folder / "run.npz", SHORT, every=2), SHORT, every=2
    ),
    "no voltage, position counts down, kN": Case(
        lambda folder: csv(folder / "run.csv", FEW), FEW
    ),
    "topics of two rates": Case(bag_of(PLC), PLC),
    "a bag of ROS 1 without temperatures": Case(
        lambda folder: arm.write_ros1(folder / "run.bag", topics(PLC[:7]), packed=False), PLC[:7]
    ),
    "joint states of an arm": Case(
        lambda folder: arm.write_ros2(
            folder / "run",
            joint_states(["base", "elbow"], *STATES, others=(*PLC[6:7], *PLC[3:4])),
        ),
        (*STATES, *PLC[6:7], *PLC[3:4]),
    ),
    "millimetres declared as metres": Case(
        lambda folder: csv(folder / "run.csv", WITH_UNITS), WITH_UNITS,
        ("unit: mm", "unit: m"),
        refused="actuator_position reads .* m, .* outside its range .*: its unit is m, should it",
    ),
    "a sign that the power balance contradicts": Case(
        lambda folder: csv(folder / "run.csv", WITH_UNITS), WITH_UNITS,
        ("(drive_current_A.*\n.*\n    sign:) -1", r"\1 1"),
        refused="motor_current: copper loss: .* must be above 0: correct its sign in",
    ),
    "a rate that drifts": Case(
        bag_of(PLC[:7], slow=2), PLC[:7],
        said="readings come at 50 Hz from .* s on, declared are 100 Hz: taken by their stamps",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", in_turn(list(CASES), 2))
def test_a_recording_ends_right_or_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    case = CASES[name]
    recording, stand = case.make(tmp_path), tmp_path / "mine"
    said = main(["stand", "new", str(stand), "--from", str(recording)])
    old, new = case.edit
    channels = stand / "channels.yaml"
    text, edits = re.subn(old, new, channels.read_text(encoding="utf-8"), count=bool(old))
    channels.write_text(text if old else channels.read_text(encoding="utf-8"), encoding="utf-8")
    assert edits == 1 or not old
    capsys.readouterr()
    status = main(["import", "--stand", str(stand), str(recording), "-o", str(tmp_path / "bags")])
    errors = capsys.readouterr().err
    if case.refused:
        assert status == 1
        assert re.search(case.refused, errors)
        assert not (tmp_path / "bags").exists()
        return
    assert (said, status) == (0, 0)
    assert re.search(case.said, errors) if case.said else errors == ""
    scans = [r for _, r in read_bag(tmp_path / "bags" / "run", (Scan,)) if isinstance(r, Scan)]
    values = np.array([scan.values for scan in scans])
    assert set(scans[0].channels) == {each.channel for each in case.sent}
    for each in case.sent:
        column = values[:, scans[0].channels.index(each.channel)]
        expected = truth(each.channel)[:: case.every]
        step = max(1, each.every // case.every)
        count = min(len(column), len(expected))
        assert count > 0.98 * len(expected)
        # Readings that were lost are on a line between their neighbours.
        count = count // 2 if case.said else count
        tolerance = 1e-6 * float(np.abs(expected).max())
        np.testing.assert_allclose(column[:count:step], expected[:count:step], atol=tolerance)


SIGNS = {
    "motor_current": "motor_current: copper loss: voltage by current is -",
    "motor_voltage": "motor_voltage: back-EMF: voltage by speed is -",
    "motor_speed": "motor_speed: speed by rate of position is -",
    "load_force": "load_force: work on the load: current by load is -",
    "actuator_position": "actuator_position reads -.* outside its range of .*: correct unit, sign,",
}


def test_each_turned_sign_is_refused_by_the_channel_that_it_is_of(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recording = csv(tmp_path / "run.csv", WITH_UNITS)
    sensors = {
        each.channel: {
            "column": each.name, "sign": int(each.sign),
            "unit": each.unit or "AV"["volt" in each.name],
            "range": [0.0, 0.1] if each.channel == "actuator_position" else [-3000.0, 3000.0],
        }
        for each in WITH_UNITS[:5]
    }  # fmt: skip
    mapping = {"schema_version": 1, "rate_hz": 100.0, "channels": sensors}
    stand = arm.arm_stand(tmp_path / "mine", mapping)
    channels = stand / "channels.yaml"
    for channel, words in SIGNS.items():
        turned = {**sensors[channel], "sign": -int(str(sensors[channel]["sign"]))}
        rows = {**mapping, "channels": {**sensors, channel: turned}}
        channels.write_text(yaml.safe_dump(rows), encoding="utf-8")
        capsys.readouterr()
        given = ["--stand", str(stand), str(recording), "-o", str(tmp_path / "bags")]
        assert main(["import", *given]) == 1
        told = capsys.readouterr().err.splitlines()[0]
        assert re.search(words, told), told
        assert str(channels) in told
    assert not (tmp_path / "bags").exists()
