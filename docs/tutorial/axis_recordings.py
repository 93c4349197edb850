"""Recordings as the drive of a vertical axis makes them: of each bag of flea simulate one.

    python docs/tutorial/axis_recordings.py bags/* -o recordings

A bag holds JointState messages of axis and brake at 100 Hz, a BatteryState of the DC link, and a
Temperature twice a second.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from flea_diag.wire.bags.bag import read_bag
from flea_diag.wire.records import Scan

STORE = get_typestore(Stores.ROS2_JAZZY)
T = STORE.types
JOINTS, WARM, LINK = "/joint_states", "/lift/temperature", "/lift/link"
TURNS, WARM_EVERY = 250.0, 50
"""Radians of the motor for a metre, and scans from one temperature to the next."""


def messages(scans: list[Scan]) -> Iterator[tuple[str, int, Any]]:
    """Topic, stamp and message: what the drive publishes."""
    for number, scan in enumerate(scans):
        current, speed, height, degc, volts, braked = scan.values
        seconds, rest = divmod(scan.stamp_ns, 10**9)
        header = T["std_msgs/msg/Header"](T["builtin_interfaces/msg/Time"](seconds, rest), "")
        rows = ([height, braked], [speed / TURNS, 0.0], [current, 0.0])
        arrays = (np.array(row) for row in rows)
        state = T["sensor_msgs/msg/JointState"](header, ["lift", "lift_brake"], *arrays)
        yield JOINTS, scan.stamp_ns, state
        yield LINK, scan.stamp_ns, _battery(header, volts)
        if number % WARM_EVERY == 0:
            yield WARM, scan.stamp_ns, T["sensor_msgs/msg/Temperature"](header, degc, 0.0)


def _battery(header: Any, volts: float) -> Any:
    """A link of this voltage, of which nothing else is known."""
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


def write_bag(folder: Path, scans: list[Scan]) -> None:
    """A rosbag2 bag in MCAP."""
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        topics: dict[str, Any] = {}
        for topic, stamp_ns, message in messages(scans):
            kind = message.__msgtype__
            if topic not in topics:
                topics[topic] = bag.add_connection(topic, kind, typestore=STORE)
            bag.write(topics[topic], stamp_ns, STORE.serialize_cdr(message, kind))


def main() -> None:
    """Write a recording of each bag."""
    parser = argparse.ArgumentParser(description="Recordings of simulated vertical axes.")
    parser.add_argument("bags", nargs="+", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    arguments = parser.parse_args()
    arguments.output.mkdir(parents=True, exist_ok=True)
    for bag in arguments.bags:
        scans = [record for _, record in read_bag(bag, (Scan,)) if isinstance(record, Scan)]
        write_bag(arguments.output / bag.name, scans)


if __name__ == "__main__":
    main()
