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

"""Bags of one motion as robots record them: habits and defects that are drawn."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from support.foreign import arm
from support.foreign.table_dialects import Motion, Rng

START_NS = 1_700_000_000 * 10**9
SECOND_NS = 10**9
STAMPS = ("true", "true", "zero", "some zero", "standing", "simulated", "a year off", "uneven")
ODD = ("nothing", "order flips", "twice", "a gap", "lost", "shuffled", "some not a number",
       "a second publisher", "another list of names")  # fmt: skip
BESIDE = (
    "nothing",
    "an early topic",
    "a late topic",
    "a log",
    "a clock",
    "an inertial unit",
    "a namespace",
)
NAMES = (("shoulder", "elbow"), ("joint_1", "joint_2"), ("gelenk 1", "Gelenk ä[2]"))


@dataclass(frozen=True)
class BagDialect:
    """How a bag came about."""

    stamps: str
    odd: str
    beside: str
    names: tuple[str, str]

    @property
    def words(self) -> str:
        """What it is, for people."""
        names = ", ".join(self.names)
        return f"bag of {names}; stamps {self.stamps}; {self.odd}; beside {self.beside}"


def drawn_bag(rng: Rng) -> BagDialect:
    """One of some thousand bags."""
    return BagDialect(
        str(rng.choice(STAMPS)), str(rng.choice(ODD)), str(rng.choice(BESIDE)),
        NAMES[int(rng.integers(len(NAMES)))],
    )  # fmt: skip


def plain_bag(dialect: BagDialect) -> BagDialect:
    """The same joints in the plainest bag."""
    return BagDialect("true", "nothing", "nothing", dialect.names)


def bag_of(folder: Path, motion: Motion, dialect: BagDialect, rng: Rng) -> Path:
    """A bag of JointState of two joints, of which the second moves, and what is beside it."""
    sent = [*_states(motion, dialect, rng), *_beside(motion, dialect)]
    sent.sort(key=lambda row: row[1])
    return arm.write_ros2(folder, iter(sent))


def _stamp(dialect: BagDialect, number: int, log_ns: int, rng: Rng) -> int:
    return {
        "zero": 0,
        "some zero": 0 if number % 90 == 7 else log_ns,
        "standing": START_NS,
        "simulated": log_ns - START_NS + 22 * SECOND_NS,
        "a year off": log_ns - 365 * 86_400 * SECOND_NS,
        "uneven": log_ns - 5_000_000 + int(rng.uniform(-3e6, 3e6)),
    }.get(dialect.stamps, log_ns)


def _states(motion: Motion, dialect: BagDialect, rng: Rng) -> Iterator[tuple[str, int, Any]]:
    topic = "/left/joint_states" if dialect.beside == "a namespace" else "/joint_states"
    order = np.arange(len(motion.time_s))
    if dialect.odd == "shuffled":
        for k in range(20, len(order) - 10, 60):
            order[[k, k + 2]] = order[[k + 2, k]]
    for place, k in enumerate(order.tolist()):
        if (dialect.odd == "a gap" and 250 <= k < 310) or (
            dialect.odd == "lost" and rng.random() < 0.15
        ):
            continue
        log_ns = START_NS + round(1e9 * float(motion.time_s[place]))
        true_ns = START_NS + round(1e9 * float(motion.time_s[k]))
        header = arm.header_at(_stamp(dialect, k, true_ns, rng))
        effort = float(motion.current[k])
        if dialect.odd == "some not a number" and k % 50 == 3:
            effort = float("nan")
        rows = [[0.3, float(motion.position[k])], [0.0, float(motion.speed[k])], [0.1, effort]]
        names = list(dialect.names)
        if dialect.odd == "order flips" and k % 2:
            names, rows = names[::-1], [row[::-1] for row in rows]
        yield topic, log_ns, arm.joint_state(header, names, *rows)
        if dialect.odd == "twice" and k % 5 == 0:
            yield topic, log_ns, arm.joint_state(header, names, *rows)
        if dialect.odd == "a second publisher" and k % 10 == 4:
            late = arm.header_at(_stamp(dialect, k, true_ns + 3_000_000, rng))
            yield topic, log_ns + 3_000_000, arm.joint_state(late, names, [0.0, 0.0], [], [])
        if dialect.odd == "another list of names" and k % 2:
            yield topic, log_ns + 1000, arm.joint_state(header, ["finger"], [0.01], [0.0], [0.0])


def _beside(motion: Motion, dialect: BagDialect) -> Iterator[tuple[str, int, Any]]:
    """Another topic; what it holds is of no interest."""
    end_s = float(motion.time_s[-1])
    times = {"an early topic": (0.0, 0.6 * end_s), "a late topic": (0.7 * end_s, end_s)}
    begin, end = times.get(dialect.beside, (0.0, end_s))
    seconds = np.arange(begin, end, 0.05)
    t = arm.T
    zeros, turn = np.zeros(9), t["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.1, 0.99)
    for number, second in enumerate(seconds.tolist()):
        log_ns = START_NS + round(1e9 * second) + 1
        vector = t["geometry_msgs/msg/Vector3"](0.01 * np.sin(second), 0.0, 9.8)
        if dialect.beside in times:
            yield "/gripper", log_ns, t["std_msgs/msg/Float64"](0.02 + 0.01 * np.sin(0.3 * second))
        elif dialect.beside == "a clock":
            time = t["builtin_interfaces/msg/Time"](22 + int(second), 7 * number)
            yield "/clock", log_ns, t["rosgraph_msgs/msg/Clock"](time)
        elif dialect.beside == "a log":
            header = arm.header_at(log_ns)
            log = t["rcl_interfaces/msg/Log"](header.stamp, 20, "a", "b", "c.cpp", "f", number % 60)
            yield "/rosout", log_ns, log
        elif dialect.beside == "an inertial unit" and dialect.stamps in (
            "true",
            "zero",
            "some zero",
        ):
            header = arm.header_at(log_ns)
            imu = t["sensor_msgs/msg/Imu"](header, turn, zeros, vector, zeros, vector, zeros)
            yield "/imu", log_ns, imu
        elif dialect.beside == "a namespace":
            header = arm.header_at(_beside_stamp(dialect, log_ns))
            rows = [[0.3, 0.02 * np.sin(second)], [0.0, 0.02 * np.cos(second)], [0.1, 0.3]]
            yield "/right/joint_states", log_ns, arm.joint_state(header, list(dialect.names), *rows)


def _beside_stamp(dialect: BagDialect, log_ns: int) -> int:
    shift = {"simulated": 22 * SECOND_NS - START_NS, "a year off": -365 * 86_400 * SECOND_NS}
    return log_ns + shift.get(dialect.stamps, 0)
