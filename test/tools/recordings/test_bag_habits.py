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

"""What robots' bags do to a recording, said by name: clocks, publishers, angles, empty arrays."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.foreign import arm
from support.foreign.table_dialects import Motion
from support.places import CONFIG

from flea_diag.tools.main import main
from flea_diag.tools.recordings.bag_clocks import received_topics
from flea_diag.wire.bags.bag import read_bag
from flea_diag.wire.records import Scan

START_NS = 1_700_000_000 * 10**9
STEP_NS = 10_000_000
MOTION = Motion.drawn(np.random.default_rng(4), 1200)
FIELDS = {"motor_current": ("effort", "A"), "motor_speed": ("velocity", "rad/s"),
          "actuator_position": ("position", "rad")}  # fmt: skip
Sent = tuple[int, int, list[str], list[list[float]]]
"""Stamp, time of receipt, names, and arrays of one message."""


def states() -> Iterator[Sent]:
    rows = zip(MOTION.position, MOTION.speed, MOTION.current, strict=True)
    for k, (q, v, i) in enumerate(rows):
        stamp_ns = START_NS + k * STEP_NS
        yield stamp_ns, stamp_ns, ["shoulder", "elbow"], [[0.3, q], [0.0, v], [0.1, i]]


def with_a_second_publisher() -> Iterator[Sent]:
    for k, row in enumerate(states()):
        yield row
        if k % 10 == 3:
            late = row[0] + 3_000_000
            yield late, late, ["elbow", "shoulder"], [[0.0, 0.0], [], []]


def with_a_second_publisher_of_the_same_names() -> Iterator[Sent]:
    for k, row in enumerate(states()):
        yield row
        if k % 10 == 3:
            late = row[0] + 3_000_000 + 200_000 * (k % 7)
            yield late, late, ["shoulder", "elbow"], [[0.0, 0.0], [0.0, 0.0], [0.0, 0.0]]


def with_two_publishers_of_one_rate() -> Iterator[Sent]:
    """Two robots on one topic, both in motion, half a period apart."""
    for k, row in enumerate(states()):
        yield row
        late, x = row[0] + 5_000_000, 0.01 * k
        q, v = 1.0 + np.sin(x), 80.0 * np.cos(x)
        yield late, late, ["shoulder", "elbow"], [[0.0, q], [0.0, v], [0.0, 4.0 + np.cos(x)]]


def with_turns() -> Iterator[Sent]:
    for stamp, log, names, rows in states():
        wrapped = float(np.angle(np.exp(1j * 2.0 * rows[0][1])))
        yield stamp, log, names, [[0.3, wrapped], *rows[1:]]


def in_two_orders() -> Iterator[Sent]:
    for k, (stamp, log, names, rows) in enumerate(states()):
        turn = slice(None, None, -1 if k % 2 else 1)
        yield stamp, log, names[turn], [row[turn] for row in rows]


def with_a_clock_that_stands() -> Iterator[Sent]:
    return ((START_NS, log, names, rows) for _, log, names, rows in states())


def with_a_clock_that_is_set() -> Iterator[Sent]:
    for k, (stamp, log, names, rows) in enumerate(states()):
        yield stamp - (3 * 10**9 if k >= 600 else 0), log, names, rows


def without_velocities() -> Iterator[Sent]:
    return ((stamp, log, names, [q, [], i]) for stamp, log, names, (q, _, i) in states())


CASES: dict[Callable[[], Iterator[Sent]], tuple[int, int, str]] = {
    states: (0, 1, ""),
    with_a_second_publisher: (0, 1, "120 of 1320 messages name .* with position alone"),
    with_a_second_publisher_of_the_same_names: (0, 1, "at a rate of their own: a second publisher"),
    with_two_publishers_of_one_rate: (1, 0, "two publishers of the same fields take turns"),
    in_two_orders: (0, 1, "the order of its names changes: read by name"),
    with_a_clock_that_stands: (0, 1, "its stamps stand still: times of receipt are taken instead"),
    with_a_clock_that_is_set: (0, 2, "its clock was set 1 times: 2 recordings"),
    with_turns: (1, 0, r"actuator_position jumps by 6.28319 rad .* write turn: 6.28319 beside it"),
    without_velocities: (1, 0, "velocity is empty in every message"),
}  # fmt: skip
"""What is sent -> exit status, recordings, and words."""


def bag(folder: Path, sent: Iterator[Sent]) -> Path:
    def written() -> Iterator[tuple[str, int, Any]]:
        for stamp_ns, log_ns, names, rows in sent:
            yield "/joint_states", log_ns, arm.joint_state(arm.header_at(stamp_ns), names, *rows)

    return arm.write_ros2(folder, written())


def stand(folder: Path, **position: float) -> Path:
    place = {"topic": "/joint_states", "type": arm.JOINT_STATE}
    rows = {
        name: {**place, "field": f"{field}[elbow]", "unit": unit, "range": [-500.0, 500.0]}
        for name, (field, unit) in FIELDS.items()
    }
    rows["actuator_position"] |= position
    mapping = {"schema_version": 1, "rate_hz": 100.0, "channels": rows}
    return arm.arm_stand(folder, mapping, CONFIG / "stands" / "joint")


@pytest.mark.parametrize("made", CASES)
def test_a_habit_of_a_bag_is_said_by_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], made: Callable[[], Iterator[Sent]]
) -> None:
    status, count, words = CASES[made]
    recording, bags = bag(tmp_path / "run", made()), tmp_path / "bags"
    given = ["--stand", str(stand(tmp_path / "mine")), str(recording), "-o", str(bags)]
    assert main(["import", *given]) == status
    errors = capsys.readouterr().err
    assert re.search(words, errors) if words else not errors
    found = sorted(bags.iterdir()) if bags.is_dir() else []
    assert len(found) == count
    if count == 1:
        scans = [r for _, r in read_bag(found[0], (Scan,)) if isinstance(r, Scan)]
        column = scans[0].channels.index("actuator_position")
        read = [scan.values[column] for scan in scans]
        np.testing.assert_allclose(read[:1190], MOTION.position[:1190], atol=2e-3)


def test_an_angle_with_its_turn_goes_on(tmp_path: Path) -> None:
    recording, bags = bag(tmp_path / "run", with_turns()), tmp_path / "bags"
    made = stand(tmp_path / "mine", turn=2.0 * np.pi)
    assert main(["import", "--stand", str(made), str(recording), "-o", str(bags)]) == 0
    scans = [r for _, r in read_bag(bags / "run", (Scan,)) if isinstance(r, Scan)]
    column = scans[0].channels.index("actuator_position")
    read = np.array([scan.values[column] for scan in scans])
    moved = 2.0 * MOTION.position
    np.testing.assert_allclose(read - read[0], moved - moved[0], atol=1e-9)


def test_clocks_of_topics_are_held_against_each_other() -> None:
    log = [START_NS + k * STEP_NS for k in range(50)]
    rng = np.random.default_rng(2)
    uneven = [stamp + int(x) for stamp, x in zip(log, rng.uniform(-4e6, 4e6, 50), strict=True)]
    late = [stamp + int(x) for stamp, x in zip(log, rng.uniform(0.0, 9e6, 50), strict=True)]
    assert received_topics({"/a": log, "/b": log}, {"/a": log, "/b": late}) == ({}, ())
    found, words = received_topics({"/a": uneven}, {"/a": log})
    assert found == {"/a": log}
    assert "scatter more than its times of receipt" in words[0]
    # Of messages that were recorded out of order the stamps tell the order.
    uneven[20], uneven[22] = uneven[22], uneven[20]
    found, _ = received_topics({"/a": uneven}, {"/a": log})
    assert found["/a"][20:23] == [log[22], log[21], log[20]]
    apart = [stamp - 5 * 10**9 for stamp in log]
    found, words = received_topics({"/a": log, "/b": apart}, {"/a": log, "/b": log})
    assert found == {"/a": log, "/b": log}
    assert "clocks 5 s apart" in words[0]


def test_nothing_is_guessed_of_two_publishers_of_one_rate(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recording = bag(tmp_path / "run", with_two_publishers_of_one_rate())
    assert main(["stand", "new", str(tmp_path / "mine"), "--from", str(recording)]) == 2
    assert "/joint_states: two publishers of the same fields take turns" in capsys.readouterr().err
