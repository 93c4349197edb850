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

"""Tables as the software of other makes writes them, all of motions that are drawn."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from support.foreign.table_dialects import Motion

ROWS = 1200
JOINTS = 7


def motions() -> list[Motion]:
    """One for each joint, the same at every call."""
    return [Motion.drawn(np.random.default_rng(seed), ROWS) for seed in range(JOINTS)]


@dataclass(frozen=True)
class Make:
    """A file of one make: how it is written, options of ``stand new``, and the right sources.

    ``says``: words of the line that it ends in where it cannot be right.
    """

    ending: str
    text: Callable[[], str]
    sources: tuple[str, ...] = ()
    options: tuple[str, ...] = ()
    says: str = ""
    encoding: str = "utf-8"


def write(folder: Path, name: str, make: Make) -> Path:
    """The file."""
    path = folder / f"{name.replace(' ', '_')}{make.ending}"
    path.write_bytes(make.text().encode(make.encoding))
    return path


def _lines(head: Sequence[str], rows: Sequence[Sequence[float]], mark: str = ",") -> str:
    text = [mark.join(head), *(mark.join(f"{x:.8g}" for x in row) for row in rows)]
    return "\n".join(text) + "\n"


def _of(k: int, *parts: Callable[[Motion, int], float]) -> list[float]:
    return [part(m, k) for part in parts for m in _KNOWN]


_KNOWN = motions()
_FIRST = _KNOWN[0]


def _q(m: Motion, k: int) -> float:
    return float(m.position[k])


def _qd(m: Motion, k: int) -> float:
    return float(m.speed[k]) / 80.0


def _i(m: Motion, k: int) -> float:
    return float(m.current[k])


def universal_robots() -> str:
    """RTDE, by blanks."""
    kinds = ("target_q", "target_qd", "target_current", "actual_q", "actual_qd", "actual_current")
    head = ["timestamp", *(f"{kind}_{j}" for kind in kinds for j in range(JOINTS)),
            "robot_mode", "runtime_state", "actual_robot_voltage"]  # fmt: skip
    rows = [
        [5000.0 + 0.01 * k, *_of(k, _q, _qd, _i, _q, _qd, lambda m, k: 1.01 * _i(m, k)),
         7.0, 2.0, 47.9 + 0.01 * (k % 7)]
        for k in range(ROWS)
    ]  # fmt: skip
    return _lines(head, rows, " ")


def franka() -> str:
    """Joint states and external torques."""
    head = ["time", *(f"{kind}{j}" for kind in ("q", "dq", "tau_J", "tau_ext")
                      for j in range(JOINTS))]  # fmt: skip
    rng = np.random.default_rng(1)
    rows = [
        [0.01 * k, *_of(k, _q, _qd, lambda m, k: 9.0 * _i(m, k)), *rng.normal(0.0, 0.1, JOINTS)]
        for k in range(ROWS)
    ]
    return _lines(head, rows)


def milling_machine() -> str:
    """Axes of a controller at 10 Hz without times."""
    parts = ("ActualPosition", "ActualVelocity", "CommandPosition", "CurrentFeedback",
             "DCBusVoltage", "OutputVoltage")  # fmt: skip
    head = [f"{axis}1_{part}" for axis in "XYZS" for part in parts]
    rows = []
    for k in range(0, ROWS, 10):
        row: list[float] = []
        for m in _KNOWN[:4]:
            moved = [40.0 * _q(m, k), 4.0 * _qd(m, k)]
            row += [*moved, moved[0], _i(m, k), 0.003 * abs(_i(m, k)), abs(_qd(m, k))]
        rows.append([*row, 1.0, float(k // 100), 50.0])
    return _lines([*head, "M1_PROGRAM_NUMBER", "M1_sequence_number", "M1_FEEDRATE"], rows)


def odrive() -> str:
    """Estimates in turns of the motor."""
    head = ("t", "pos_estimate", "vel_estimate", "Iq_setpoint", "Iq_measured", "bus_voltage",
            "fet_temp", "axis_error", "current_state")  # fmt: skip
    turn = 2.0 * math.pi
    rows = [
        [0.01 * k, 80.0 * _q(_FIRST, k) / turn, 80.0 * _qd(_FIRST, k) / turn,
         0.99 * _i(_FIRST, k), _i(_FIRST, k), 24.0 - 0.05 * abs(_i(_FIRST, k)), 30.0 + 1e-3 * k,
         0.0, 8.0]
        for k in range(ROWS)
    ]  # fmt: skip
    return _lines(head, rows)


def plc_scope() -> str:
    """A column of times for each signal, six lines before them, decimal commas, tabs."""
    before = ["Name\tScope Project", "File\tC:\\run.svdx", "",
              "Name\tActTorque\tName\tActVelo\tName\tActPos",
              "SymbolComment\t\tSymbolComment\t\tSymbolComment\t",
              "Sample time\t10\tSample time\t10\tSample time\t10", ""]  # fmt: skip
    rows = (
        f"{10 * k}\t{_i(_FIRST, k):.5f}\t{10 * k}\t{80.0 * _qd(_FIRST, k):.5f}\t{10 * k}\t"
        f"{_q(_FIRST, k):.6f}".replace(".", ",")
        for k in range(ROWS)
    )
    return "\n".join([*before, *rows]) + "\n"


def measurement_file() -> str:
    """Lines of keys, an end of them, units in the names, a column of comments without cells."""
    before = ["Measurement", "Writer_Version\t2", "Separator\tTab", "***End_of_Header***", "",
              "Channels\t3",
              "X_Value\tMotor Current (A)\tMotor Speed (rpm)\tPosition (deg)\tComment"]  # fmt: skip
    rows = (
        f"{0.01 * k:.6f}\t{_i(_FIRST, k):.5f}\t{764.0 * _qd(_FIRST, k):.4f}\t"
        f"{math.degrees(_q(_FIRST, k)):.5f}"
        for k in range(ROWS)
    )
    return "\n".join([*before, *rows]) + "\n"


def topic_as_text() -> str:
    """A JointState as rostopic prints it, by columns."""
    head = "%time,field.header.seq,field.header.stamp,field.header.frame_id,field.name0,field.name1"
    kinds = ("position", "velocity", "effort")
    head = ",".join([head, *(f"field.{kind}{j}" for kind in kinds for j in (0, 1))])
    rows = [head]
    for k in range(ROWS):
        stamp = 1_700_000_000_000_000_000 + k * 10_000_000
        cells = [0.3, _q(_FIRST, k), 0.0, _qd(_FIRST, k), 0.1, _i(_FIRST, k)]
        rows.append(f"{stamp},{k},{stamp},,shoulder,elbow," + ",".join(f"{x:.6f}" for x in cells))
    return "\n".join(rows) + "\n"


def drive_trace() -> str:
    """German names, units in a line of their own, decimal commas."""
    rows = (
        f"{0.01 * k:.3f};{math.degrees(_q(_FIRST, k)):.4f};{764.0 * _qd(_FIRST, k):.3f};"
        f"{_i(_FIRST, k):.4f};{40.0 + 2e-3 * k:.2f}".replace(".", ",")
        for k in range(ROWS)
    )
    head = ["Zeit;Istlage;Istdrehzahl;Strom Iq;Temperatur Motor", "s;°;1/min;A;°C"]
    return "\n".join([*head, *rows]) + "\n"


def sheet_of_days() -> str:
    """Times as fractions of days."""
    rows = [
        f"{45356.4166667 + 0.01 * k / 86400.0:.10f},{_i(_FIRST, k):.5f},"
        f"{764.0 * _qd(_FIRST, k):.4f},{math.degrees(_q(_FIRST, k)):.5f}"
        for k in range(ROWS)
    ]
    return "\n".join(["Date,Current [A],Speed [rpm],Angle [deg]", *rows]) + "\n"


def arm_controller() -> str:
    """Axes A1 to A7 with units in the names."""
    kinds = ("ActPos_deg", "ActVel_deg_s", "Torque_Nm")
    head = ["Time_ms", *(f"A{j}_{kind}" for j in range(1, JOINTS + 1) for kind in kinds)]
    rows = [
        [10.0 * k, *(x for m in _KNOWN for x in (
            math.degrees(_q(m, k)), math.degrees(_qd(m, k)), 50.0 * _i(m, k)))]
        for k in range(ROWS)
    ]  # fmt: skip
    return _lines(head, rows, ";")


def linear_actuator() -> str:
    """Units in the names and no times."""
    rng = np.random.default_rng(3)
    rows = [
        [30.0 * _q(_FIRST, k), 30.0 * _qd(_FIRST, k), _i(_FIRST, k),
         200.0 * _i(_FIRST, k) + float(rng.normal(0.0, 5.0))]
        for k in range(ROWS)
    ]  # fmt: skip
    return _lines(("Position_mm", "Velocity_mm_s", "Current_A", "Force_N"), rows)


def microcontroller() -> str:
    """Milliseconds that are uneven, and a line that is garbled."""
    rng = np.random.default_rng(5)
    at, rows = 0, ["millis;elbow_pos;elbow_speed;elbow_current"]
    for k in range(ROWS):
        at += int(rng.choice([9, 10, 11, 12]))
        rows.append(f"{at};{_q(_FIRST, k):.4f};{80.0 * _qd(_FIRST, k):.3f};{_i(_FIRST, k):.3f}")
    rows.insert(500, "millis;elbow_pos;elb")
    return "\n".join(rows) + "\n"


def data_frame() -> str:
    """Two lines of names: groups, and what is in them."""
    rows = [
        f"{0.01 * k:.3f},{_i(_FIRST, k):.5f},{80.0 * _qd(_FIRST, k):.4f},"
        f"{_q(_FIRST, k):.5f},.1,0,.3"
        for k in range(ROWS)
    ]
    head = ["time,elbow,elbow,elbow,shoulder,shoulder,shoulder",
            ",current,velocity,position,current,velocity,position"]  # fmt: skip
    return "\n".join([*head, *rows]) + "\n"


MAKES: dict[str, Make] = {
    "robot arm, RTDE": Make(".csv", universal_robots, (
        "actual_current_{}", "actual_qd_{}", "actual_q_{}")),
    "robot arm, torques": Make(".csv", franka, ("tau_J{}", "dq{}", "q{}")),
    "milling machine without times": Make(".csv", milling_machine, says="no column holds times"),
    "milling machine": Make(".csv", milling_machine, (
        "X1_CurrentFeedback", "X1_ActualVelocity", "X1_ActualPosition"),
        ("--rate", "10", "--joint", "X")),
    "motor controller in turns": Make(".csv", odrive, (
        "Iq_measured", "vel_estimate", "pos_estimate")),
    "scope of a PLC": Make(".csv", plc_scope, ("ActTorque", "ActVelo", "ActPos")),
    "measurement file": Make(".txt", measurement_file, (
        "Motor Current (A)", "Motor Speed (rpm)", "Position (deg)")),
    "topic as text": Make(".csv", topic_as_text, (
        "field.effort1", "field.velocity1", "field.position1")),
    "trace of a drive, German": Make(".csv", drive_trace, (
        "Strom Iq", "Istdrehzahl", "Istlage"), encoding="cp1252"),
    "sheet with days": Make(".csv", sheet_of_days, (
        "Current [A]", "Speed [rpm]", "Angle [deg]")),
    "controller of an arm": Make(".csv", arm_controller, (
        "A{}_Torque_Nm", "A{}_ActVel_deg_s", "A{}_ActPos_deg")),
    "linear actuator without times": Make(".csv", linear_actuator, says="no column holds times"),
    "linear actuator": Make(".csv", linear_actuator, (
        "Current_A", "Velocity_mm_s", "Position_mm"), ("--rate", "100")),
    "microcontroller": Make(".txt", microcontroller, (
        "elbow_current", "elbow_speed", "elbow_pos")),
    "data frame with groups": Make(".csv", data_frame, (
        "elbow current", "elbow velocity", "elbow position")),
}  # fmt: skip
"""Sources of current, speed and position; ``{}`` stands for the joint that is taken."""
CHANNELS = ("motor_current", "motor_speed", "actuator_position")
