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

"""Recordings as a robot makes them, for the tutorial: of each bag of flea simulate one.

    python docs/tutorial/robot_recordings.py bags/* -o recordings

A bag holds JointState messages of two joints at 100 Hz and a Temperature twice a second; the CSV
holds the same of the elbow, every 10 ms.
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
JOINTS, WARM = "/joint_states", "/elbow/temperature"
GEAR, WARM_EVERY = 80.0, 50


def messages(scans: list[Scan]) -> Iterator[tuple[str, int, Any]]:
    """Topic, stamp and message: what the controller of the arm publishes."""
    for number, scan in enumerate(scans):
        current, speed, angle, degc = scan.values
        seconds, rest = divmod(scan.stamp_ns, 10**9)
        header = T["std_msgs/msg/Header"](T["builtin_interfaces/msg/Time"](seconds, rest), "")
        rows = ([0.3, angle], [0.0, speed / GEAR], [1.5, current])
        arrays = (np.array(row) for row in rows)
        yield (
            JOINTS,
            scan.stamp_ns,
            T["sensor_msgs/msg/JointState"](header, ["shoulder", "elbow"], *arrays),
        )
        if number % WARM_EVERY == 0:
            yield WARM, scan.stamp_ns, T["sensor_msgs/msg/Temperature"](header, degc, 0.0)


def write_bag(folder: Path, scans: list[Scan]) -> None:
    """A rosbag2 bag in MCAP."""
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        topics: dict[str, Any] = {}
        for topic, stamp_ns, message in messages(scans):
            kind = message.__msgtype__
            if topic not in topics:
                topics[topic] = bag.add_connection(topic, kind, typestore=STORE)
            bag.write(topics[topic], stamp_ns, STORE.serialize_cdr(message, kind))


def write_csv(path: Path, scans: list[Scan]) -> None:
    """A table with a column of times of day in seconds."""
    lines = ["time_s,elbow_current_a,elbow_velocity_rad_s,elbow_position_rad,elbow_temperature_c"]
    for scan in scans:
        current, speed, angle, degc = scan.values
        time = f"{scan.stamp_ns // 10**9}.{scan.stamp_ns % 10**9 // 10**6:03d}"
        lines.append(f"{time},{current:.3f},{speed / GEAR:.6f},{angle:.7f},{degc:.1f}")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def main() -> None:
    """Write a recording of each bag."""
    parser = argparse.ArgumentParser(description="Robot recordings of simulated joints.")
    parser.add_argument("bags", nargs="+", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--csv", action="store_true", help="tables instead of bags")
    arguments = parser.parse_args()
    arguments.output.mkdir(parents=True, exist_ok=True)
    for bag in arguments.bags:
        scans = [record for _, record in read_bag(bag, (Scan,)) if isinstance(record, Scan)]
        if arguments.csv:
            write_csv(arguments.output / f"{bag.name}.csv", scans)
        else:
            write_bag(arguments.output / bag.name, scans)


if __name__ == "__main__":
    main()
