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

"""Recordings as the drives of other machines make them: of each bag of flea simulate one.

    python docs/tutorial/machine_recordings.py axis bags/* -o recordings
    python docs/tutorial/machine_recordings.py gimbal bags/* --csv -o tables

The drive of the axis publishes JointState of carriage and brake, a Temperature and a BatteryState
of its link; the controller of the shoulder JointState, the torque as a WrenchStamped, a Temperature
and a BatteryState; the driver of the gimbal JointState and an Imu.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from flea_diag.wire.bags.bag import read_bag
from flea_diag.wire.records import Scan

STORE = get_typestore(Stores.ROS2_JAZZY)
T = STORE.types
WARM_EVERY = 50
"""Scans from one temperature to the next."""
Sent = Iterator[tuple[str, Any]]


def axis(header: Any, row: tuple[float, ...], number: int) -> Sent:
    """Topics and messages of one scan of the vertical axis; 250 rad of the motor are a metre."""
    current, speed, height, degc, volts, braked = row
    joints = {"lift": (height, speed / 250.0, current), "lift_brake": (braked, 0.0, 0.0)}
    yield "/joint_states", _joints(header, joints)
    yield "/lift/link", _battery(header, volts)
    if number % WARM_EVERY == 0:
        yield "/lift/temperature", T["sensor_msgs/msg/Temperature"](header, degc, 0.0)


def shoulder(header: Any, row: tuple[float, ...], number: int) -> Sent:
    """Those of the robot's shoulder; its gear has 100 turns of the motor to one."""
    current, speed, angle, torque, degc, volts = row
    joints = {"shoulder": (angle, speed / 100.0, current), "elbow": (0.4, 0.0, 1.2)}
    vector = T["geometry_msgs/msg/Vector3"]
    felt = T["geometry_msgs/msg/Wrench"](
        force=vector(0.0, 0.0, 0.0), torque=vector(0.0, 0.0, torque)
    )
    yield "/joint_states", _joints(header, joints)
    yield "/shoulder/torque", T["geometry_msgs/msg/WrenchStamped"](header, felt)
    yield "/battery", _battery(header, volts)
    if number % WARM_EVERY == 0:
        yield "/shoulder/temperature", T["sensor_msgs/msg/Temperature"](header, degc, 0.0)


def gimbal(header: Any, row: tuple[float, ...], number: int) -> Sent:
    """Those of the camera's gimbal."""
    current, rate, angle = row
    vector, unknown = T["geometry_msgs/msg/Vector3"], np.zeros(9)
    yield "/gimbal/joint_states", _joints(header, {"tilt": (angle, rate, current)})
    yield "/camera/imu", T["sensor_msgs/msg/Imu"](
        header, T["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0), unknown,
        vector(0.0, rate, 0.0), unknown, vector(0.0, 0.0, 9.81), unknown,
    )  # fmt: skip


MACHINES: dict[str, Callable[[Any, tuple[float, ...], int], Sent]] = {
    "axis": axis,
    "shoulder": shoulder,
    "gimbal": gimbal,
}
COLUMNS = {
    "axis": "time_s,lift_current_a,motor_speed_rad_s,lift_position_m,motor_temperature_c,"
    "bus_voltage_v,brake_engaged",
    "shoulder": "time_s,shoulder_current_a,motor_speed_rad_s,shoulder_angle_rad,"
    "shoulder_torque_nm,motor_temperature_c,battery_v",
    "gimbal": "time_s,tilt_current_a,tilt_rate_rad_s,tilt_angle_rad",
}


def messages(machine: str, scans: Iterable[Scan]) -> Iterator[tuple[str, int, Any]]:
    """Topic, stamp and message: what the machine publishes."""
    for number, scan in enumerate(scans):
        seconds, rest = divmod(scan.stamp_ns, 10**9)
        header = T["std_msgs/msg/Header"](T["builtin_interfaces/msg/Time"](seconds, rest), "")
        for topic, message in MACHINES[machine](header, scan.values, number):
            yield topic, scan.stamp_ns, message


def _joints(header: Any, joints: dict[str, tuple[float, float, float]]) -> Any:
    """Position, velocity and effort of each joint."""
    arrays = (np.array(column) for column in zip(*joints.values(), strict=True))
    return T["sensor_msgs/msg/JointState"](header, list(joints), *arrays)


def _battery(header: Any, volts: float) -> Any:
    """A supply of this voltage, of which nothing else is known."""
    unknown, none = float("nan"), np.array([], dtype=np.float32)
    numbers = dict.fromkeys(
        ("temperature", "current", "charge", "capacity", "design_capacity", "percentage"), unknown
    )
    states = dict.fromkeys(
        ("power_supply_status", "power_supply_health", "power_supply_technology"), 0
    )
    return T["sensor_msgs/msg/BatteryState"](
        header=header, voltage=volts, **numbers, **states, present=True, cell_voltage=none,
        cell_temperature=none, location="", serial_number="",
    )  # fmt: skip


def write_bag(machine: str, folder: Path, scans: Iterable[Scan]) -> None:
    """A rosbag2 bag in MCAP."""
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        topics: dict[str, Any] = {}
        for topic, stamp_ns, message in messages(machine, scans):
            kind = message.__msgtype__
            if topic not in topics:
                topics[topic] = bag.add_connection(topic, kind, typestore=STORE)
            bag.write(topics[topic], stamp_ns, STORE.serialize_cdr(message, kind))


def write_csv(machine: str, path: Path, scans: Iterable[Scan]) -> None:
    """A table with a column of times in seconds."""
    rows = np.array([(1e-9 * scan.stamp_ns, *scan.values) for scan in scans])
    form = ["%.7f", *["%.9g"] * (rows.shape[1] - 1)]
    np.savetxt(path, rows, form, delimiter=",", header=COLUMNS[machine], comments="")


def main() -> None:
    """Write a recording of each bag."""
    parser = argparse.ArgumentParser(description="Recordings of simulated machines.")
    parser.add_argument("machine", choices=MACHINES)
    parser.add_argument("bags", nargs="+", type=Path)
    parser.add_argument("--csv", action="store_true", help="tables in place of bags")
    parser.add_argument("-o", "--output", type=Path, required=True)
    arguments = parser.parse_args()
    arguments.output.mkdir(parents=True, exist_ok=True)
    for bag in arguments.bags:
        scans = [record for _, record in read_bag(bag, (Scan,)) if isinstance(record, Scan)]
        if arguments.csv:
            write_csv(arguments.machine, arguments.output / f"{bag.name}.csv", scans)
        else:
            write_bag(arguments.machine, arguments.output / bag.name, scans)


if __name__ == "__main__":
    main()
