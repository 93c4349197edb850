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

"""Every shipped stand through its own channels.yaml: healthy recordings are quiet.

The simulated machine sends what the stand's robot sends, so that scans made of the robot's messages
are the scans of the simulation, imported and live, and a healthy run is NOMINAL.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from support import in_turn
from support.neighbours.bridged import bridged
from support.places import ROOT, script

from flea_diag.configuration.channels import channel_sources
from flea_diag.configuration.stand import load_stand
from flea_diag.tools.main import main
from flea_diag.wire.bags.bag import read_bag
from flea_diag.wire.records import Scan

STANDS = sorted(path.parent.name for path in (ROOT / "config" / "stands").glob("*/channels.yaml"))
MOTIONS = ("nominal", "nominal_sweep")
HEALTHY = dict.fromkeys(("joint", "axis", "shoulder", "gimbal"), in_turn(MOTIONS, 2))
"""Stand with topics -> a healthy motion. Those with columns or text are read from the recordings
of others: test_cranfield.py, test_real_flea.py."""
ELSEWHERE = ("cranfield", "flea")
SENT = 120
PACED = {
    "joint": "/elbow/temperature",
    "axis": "/lift/temperature",
    "shoulder": "/shoulder/temperature",
    "gimbal": "/camera/imu",
}
SINGLE = {"bus_voltage": 1e-7}
"""Relative error of channels that their messages hold as single floats."""


def messages_of(stand: str, scans: list[Scan]) -> Iterator[tuple[str, int, Any]]:
    """What the machine publishes, by the tutorials' scripts."""
    if stand == "joint":
        yield from tutorial("robot_recordings").messages(scans)
    else:
        yield from tutorial("machine_recordings").messages(stand, scans)


def write_bag(stand: str, folder: Path, scans: list[Scan]) -> None:
    """The same as a bag."""
    if stand == "joint":
        tutorial("robot_recordings").write_bag(folder, scans)
    else:
        tutorial("machine_recordings").write_bag(stand, folder, scans)


def tutorial(name: str) -> Any:
    """A script that makes messages of simulated scans."""
    return script(f"docs/tutorial/{name}.py")


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a bag of a motion of each stand, of a unit that no calibration saw."""
    folder = tmp_path_factory.mktemp("simulated")
    for stand, motions in HEALTHY.items():
        for motion in motions:
            given = f"--machine {stand} --unit-seed 7 --seed 41 --duration 30".split()
            assert main(["simulate", motion, *given, "-o", str(folder / stand / motion)]) == 0
    return folder


def scans_of(bag: Path) -> list[Scan]:
    return [record for _, record in read_bag(bag, (Scan,)) if isinstance(record, Scan)]


def alike(one: Scan, other: Scan) -> None:
    for name, value, wanted in zip(one.channels, one.values, other.values, strict=True):
        assert value == pytest.approx(wanted, rel=SINGLE.get(name, 1e-12))


def test_every_shipped_mapping_is_tested() -> None:
    assert set(STANDS) == {*HEALTHY, *ELSEWHERE}


@pytest.mark.parametrize("stand", HEALTHY)
def test_healthy_recordings_are_quiet_through_the_mapping(
    stand: str, simulated: Path, tmp_path: Path
) -> None:
    for bag in (simulated / stand).iterdir():
        write_bag(stand, tmp_path / "recordings" / bag.name, scans_of(bag))
    recorded = sorted(str(path) for path in (tmp_path / "recordings").iterdir())
    bags, told = tmp_path / "bags", tmp_path / "verdict.json"
    assert main(["import", "--stand", stand, *recorded, "-o", str(bags)]) == 0
    for motion in HEALTHY[stand]:
        expected = scans_of(simulated / stand / motion)
        made = scans_of(bags / motion)
        assert [scan.stamp_ns for scan in made] == [scan.stamp_ns for scan in expected]
        # The gear is divided out of the speed and multiplied in again.
        for one, other in zip(made, expected, strict=True):
            assert one.channels == other.channels
            alike(one, other)
        assert main(["replay", str(bags / motion), "--stand", stand, "--json", str(told)]) == 0
        verdict = json.loads(told.read_text(encoding="utf-8"))
        assert (verdict["outcome"], verdict["episodes"]) == ("NOMINAL", [])


@pytest.mark.parametrize("stand", HEALTHY)
def test_live_scans_are_those_of_the_simulation(stand: str, simulated: Path, domain: int) -> None:
    pytest.importorskip("rclpy", reason="needs ROS 2: rclpy is not installed")
    expected = scans_of(simulated / stand / HEALTHY[stand][0])[:SENT]
    messages = list(messages_of(stand, expected))
    assert {topic for topic, *_ in messages} == set(channel_sources(load_stand(stand)).topics)
    scans, *_ = bridged(domain, stand, messages, PACED[stand], SENT - 4)
    assert [scan.stamp_ns for scan in scans] == [s.stamp_ns for s in expected[: len(scans)]]
    for one, other in zip(scans, expected, strict=False):
        alike(one, other)
