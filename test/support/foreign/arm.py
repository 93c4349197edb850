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

"""A bag of ours as another stand would have sent it: other topics, types, units and signs."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from rosbags.typesys import Stores, get_typestore

from flea_diag.wire.bags.bag import read_bag
from flea_diag.wire.records import Scan
from support.places import FLEA_STAND

STORE = get_typestore(Stores.ROS2_JAZZY)
T = STORE.types
JOINT_STATE = "sensor_msgs/msg/JointState"
TEMPERATURE = "sensor_msgs/msg/Temperature"
STATES, VOLTAGE, SUPPLY, WRENCH, PARTS, AMBIENT = (
    "/arm/joint_states",
    "/arm/voltage",
    "/arm/supply",
    "/arm/wrench",
    "/arm/parts",
    "/arm/ambient",
)
TYPES = {
    STATES: JOINT_STATE,
    VOLTAGE: "std_msgs/msg/Float64",
    SUPPLY: "sensor_msgs/msg/BatteryState",
    WRENCH: "geometry_msgs/msg/WrenchStamped",
    PARTS: "diagnostic_msgs/msg/DiagnosticArray",
    AMBIENT: TEMPERATURE,
}
CHANNELS: dict[str, dict[str, object]] = {
    "motor_current": {
        "topic": STATES, "type": JOINT_STATE, "field": "effort[elbow]", "unit": "mA", "sign": -1,
        "range": [-60.0, 60.0],
    },
    "motor_speed": {
        "topic": STATES, "type": JOINT_STATE, "field": "velocity[elbow]", "unit": "rpm",
        "range": [-1000.0, 1000.0],
    },
    "actuator_position": {
        "topic": STATES, "type": JOINT_STATE, "field": "position[elbow]", "unit": "mm",
        "range": [-0.001, 0.12],
    },
    "motor_voltage": {
        "topic": VOLTAGE, "type": TYPES[VOLTAGE], "field": "data", "unit": "V", "scale": 2.0,
        "offset": -5.0, "range": [-40.0, 40.0], "sampling": "mean",
    },
    "commanded_voltage": {
        "topic": SUPPLY, "type": TYPES[SUPPLY], "field": "cell_voltage[1]", "unit": "V",
        "range": [-40.0, 40.0],
    },
    "load_force": {
        "topic": WRENCH, "type": TYPES[WRENCH], "field": "wrench.force.z", "unit": "lbf",
        "sign": -1, "range": [-5000.0, 5000.0],
    },
    "load_position": {
        "topic": PARTS, "type": TYPES[PARTS], "field": "status[load].values[at].value",
        "unit": "in", "range": [-0.01, 0.12],
    },
    "motor_temperature": {
        "topic": PARTS, "type": TYPES[PARTS], "field": "status[motor].values[celsius].value",
        "unit": "degC", "range": [-40.0, 200.0],
    },
    "nut_temperature": {
        "topic": PARTS, "type": TYPES[PARTS], "field": "status[0].values[0].value",
        "unit": "K", "range": [-40.0, 200.0],
    },
    "ambient_temperature": {
        "topic": AMBIENT, "type": TEMPERATURE, "field": "temperature", "unit": "degF",
        "range": [-40.0, 200.0],
    },
}  # fmt: skip
MAPPING: dict[str, object] = {"schema_version": 1, "rate_hz": 100.0, "channels": CHANNELS}


def arm_stand(
    folder: Path, mapping: dict[str, object] | None = None, like: Path = FLEA_STAND
) -> Path:
    """Folder of a stand like the FLEA, or another one, with these channels."""
    folder.mkdir()
    for path in like.glob("*.yaml"):
        (folder / path.name).write_bytes(path.read_bytes())
    text = yaml.safe_dump(mapping or MAPPING, sort_keys=False)
    (folder / "channels.yaml").write_text(text, encoding="utf-8")
    return folder


def messages(bag: Path) -> Iterator[tuple[str, int, Any]]:
    """Topic, stamp in ns and message for every scan of a bag of ours, in order."""
    for _, scan in read_bag(bag, (Scan,)):
        assert isinstance(scan, Scan)
        value = dict(zip(scan.channels, scan.values, strict=True))
        header = header_at(scan.stamp_ns)
        for topic, message in _of_scan(header, value):
            yield topic, scan.stamp_ns, message


def header_at(stamp_ns: int) -> Any:
    """Header with a stamp."""
    seconds, rest = divmod(stamp_ns, 10**9)
    return T["std_msgs/msg/Header"](T["builtin_interfaces/msg/Time"](seconds, rest), "")


def joint_state(header: Any, names: list[str], *rows: list[float]) -> Any:
    """JointState with positions, velocities and efforts."""
    return T[JOINT_STATE](header, names, *(np.array(row, dtype=np.float64) for row in rows))


def _of_scan(header: Any, value: dict[str, float]) -> Iterator[tuple[str, Any]]:
    yield (
        STATES,
        joint_state(
            header,
            ["shoulder", "elbow"],
            [0.5, 1e3 * value["actuator_position"]],
            [0.0, value["motor_speed"] * 30.0 / math.pi],
            [1.0, -1e3 * value["motor_current"]],
        ),
    )
    yield VOLTAGE, T["std_msgs/msg/Float64"]((value["motor_voltage"] + 5.0) / 2.0)
    supply = T[TYPES[SUPPLY]]
    cells = np.array([0.0, value["commanded_voltage"]], dtype=np.float32)
    few = np.zeros(0, dtype=np.float32)
    yield SUPPLY, supply(header, *[0.0] * 7, 0, 0, 0, True, cells, few, "", "")
    vector = T["geometry_msgs/msg/Vector3"]
    force = vector(0.0, 0.0, -value["load_force"] / 4.4482216152605)
    wrench = T["geometry_msgs/msg/Wrench"](force, vector(0.0, 0.0, 0.0))
    yield WRENCH, T[TYPES[WRENCH]](header, wrench)
    pair, status = T["diagnostic_msgs/msg/KeyValue"], T["diagnostic_msgs/msg/DiagnosticStatus"]
    parts = {
        "nut": ("kelvin", value["nut_temperature"] + 273.15),
        "load": ("at", value["load_position"] / 0.0254),
        "motor": ("celsius", value["motor_temperature"]),
    }
    rows = [status(0, n, "", "", [pair(key, repr(x))]) for n, (key, x) in parts.items()]
    yield PARTS, T[TYPES[PARTS]](header, rows)
    fahrenheit = value["ambient_temperature"] * 1.8 + 32.0
    yield AMBIENT, T[TEMPERATURE](header, fahrenheit, 0.0)


def write_ros2(folder: Path, sent: Iterator[tuple[str, int, Any]]) -> Path:
    """A rosbag2 bag in MCAP, with definitions of its types."""
    from rosbags.rosbag2 import StoragePlugin, Writer

    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        known: dict[str, Any] = {}
        for topic, stamp_ns, message in sent:
            kind = message.__msgtype__
            if topic not in known:
                known[topic] = bag.add_connection(topic, kind, typestore=STORE)
            bag.write(known[topic], stamp_ns, STORE.serialize_cdr(message, kind))
    return folder


def write_ros1(path: Path, sent: Iterator[tuple[str, int, Any]], packed: bool) -> Path:
    """A bag of ROS 1 of Float64 and Temperature messages, with bz2 or plain."""
    from rosbags.rosbag1 import Writer

    store = get_typestore(Stores.ROS1_NOETIC)
    bag = Writer(path)
    if packed:
        bag.set_compression(Writer.CompressionFormat.BZ2)
    with bag:
        known: dict[str, Any] = {}
        for topic, stamp_ns, message in sent:
            kind = message.__msgtype__
            if topic not in known:
                known[topic] = bag.add_connection(topic, kind, typestore=store)
            bag.write(known[topic], stamp_ns, store.serialize_ros1(message, kind))
    return path
