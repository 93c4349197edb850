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

"""The evidence through the nodes over DDS: the same decisions as of a replay, to the last bit."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import pytest
from support import stands
from support.flight import SOURCES, Flight
from support.live import Peer, Process, node
from support.models.linear_evidence import STAND, block, calibration, diagnosis, running, table

from flea_diag.configuration.component import evidence_pipeline
from flea_diag.stages.digest import digest
from flea_diag.tools.calibrate.calibrate import write_calibration
from flea_diag.wire.records import (
    AmbiguityGroup,
    Detection,
    FeatureRequest,
    FeatureValue,
    Outcome,
    Record,
    Residual,
    Scan,
    Symbols,
)

BETWEEN = (*SOURCES, Scan, Residual, Detection, Symbols, FeatureRequest, FeatureValue)
PATIENT = ("-p", "watermark_s:=2.0", "-p", "answer_limit_s:=60.0")
FLIGHTS = 4
"""See ``test_replay_bags``."""


def dragged() -> list[Record]:
    """A drag from 9 s to 16 s, as its stand sends it."""
    columns = {name: values[:1600] for name, values in running(coulomb=150.0).items()}
    return [table(), *block(columns).records()]


def replayed(records: list[Record]) -> list[Record]:
    """All that a replay says."""
    return stands.replay(evidence_pipeline(diagnosis(), STAND), records)


@pytest.fixture
def by_evidence(tmp_path: Path) -> tuple[str, ...]:
    """Parameters of the nodes."""
    pytest.importorskip("rclpy", reason="needs ROS 2: rclpy is not installed")
    path = tmp_path / "calibration.yaml"
    write_calibration(path, calibration())
    return "-p", "configuration:=evidence", "-p", f"calibration:={path}"


def flown(flight: Flight, rate: float, wanted: str) -> list[Record]:
    """What nodes say of it, in a flight in which nothing holds this process up."""
    for _ in range(FLIGHTS):
        said = flight.fly(dragged(), rate)
        if digest(said) == wanted:
            break
    return said


@pytest.mark.in_turn(2)
def test_three_nodes_weigh_as_a_replay(domain: int, by_evidence: tuple[str, ...]) -> None:
    expected = replayed(dragged())
    last = [record for record in expected if isinstance(record, AmbiguityGroup)][-1]
    assert last.outcome is Outcome.INDISTINGUISHABLE
    assert {member.fault for member in last.members} == {"jam", "ball_nut_friction"}
    wanted = digest(expected)
    isolator = (*PATIENT, "-p", "memory:=none", *by_evidence)
    parts = ("observer", by_evidence), ("isolator", isolator), ("extractor", ())
    with ExitStack() as running_nodes:
        for part, told in parts:
            running_nodes.enter_context(Process(node(part, *told), domain))
        flight = Flight(running_nodes.enter_context(Peer(domain)), BETWEEN)
        flight.introduce(next(r for r in dragged() if isinstance(r, Scan)))
        assert digest(flown(flight, 2.0, wanted)) == wanted


def test_a_calibration_without_a_law_is_refused_by_the_node(domain: int, tmp_path: Path) -> None:
    pytest.importorskip("rclpy", reason="needs ROS 2: rclpy is not installed")
    path = tmp_path / "older.yaml"
    write_calibration(path, replace(calibration(), law=None))
    told = "-p", "configuration:=evidence", "-p", f"calibration:={path}"
    with Process(node("observer", *told), domain) as it:
        assert it.end() == 2
    assert "no law of healthy recordings" in it.output
