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

"""The DAQ as a process on the bus: pace, live faults, end and refusals."""

from __future__ import annotations

import math
import signal
import time

import numpy as np
import pytest
from support.live import Peer, Process, node, toy

from flea_diag.wire.records import ChannelTable, Health, Scan, Truth, VibrationBlock
from flea_sim_driver.scenario.settings import DEFAULT_EPOCH_S

NANOSECONDS = 1_000_000_000
NODE = "daq"


def daq(*parameters: str) -> list[str]:
    return node(NODE, *(part for each in parameters for part in ("-p", each)))


def test_the_daq_streams_its_scenario_and_ends_by_itself(domain: int) -> None:
    command = daq("scenario:=nominal", "duration_s:=4.0", "rate:=4.0", "wait_for_subscribers:=1",
                  "fault:=motor_current_bias", "fault_onset_s:=2.0", "fault_size:=3.0")  # fmt: skip
    with Process(command, domain) as child, Peer(domain) as peer:
        peer.listen(ChannelTable, Truth, Scan, VibrationBlock, Health)
        peer.until(lambda: sum(isinstance(r, VibrationBlock) for r in peer.records) >= 40)
        assert child.end() == 0, child.output
    scans = [record for record in peer.records if isinstance(record, Scan)]
    blocks = [record for record in peer.records if isinstance(record, VibrationBlock)]
    # Discovery has two ends: the first message of a volatile topic may find only one of them.
    assert len(scans) >= 398
    assert len(blocks) == 40
    assert set(np.diff([scan.stamp_ns for scan in scans])) == {10_000_000}
    truths = [record for record in peer.records if isinstance(record, Truth)]
    assert [truth.fault for truth in truths] == ["nominal", "motor_current_bias"]
    assert truths[1].onset_ns - truths[0].stamp_ns == 2_000_000_000
    after = next(k for k, scan in enumerate(scans) if scan.stamp_ns >= truths[1].onset_ns)
    step = scans[after].value("motor_current") - scans[after - 1].value("motor_current")
    assert 2.0 < step < 4.0


def test_the_stand_starts_once_the_nodes_named_are_ready(domain: int) -> None:
    """A node that is there and not active is not ready; whoever else listens does not count."""
    with (
        Process(daq("duration_s:=0.5", "wait_for:=toy"), domain) as child,
        Process(toy("-p", "autostart:=false"), domain),
        Peer(domain, name="recorder") as early,
    ):
        early.listen(ChannelTable, Scan, Health)
        child.wait_for("waiting for toy (unconfigured) to become active", 20.0)
        assert not any(isinstance(record, Scan) for record in early.records)
        early.change_state("toy", "configure")
        early.change_state("toy", "activate")
        early.find(lambda record: isinstance(record, Scan), 20.0)
        assert child.end() == 0
        toy_had = early.find(
            lambda r: isinstance(r, Health) and dict(r.values).get("sensors/slow/received") == "50",
            20.0,
        )
    assert dict(toy_had.values)["state"] == "active"


def test_a_stand_that_waits_in_vain_says_for_whom(domain: int) -> None:
    with Process(daq("wait_for:=nobody,noone", "wait_s:=0.1"), domain) as child:
        assert child.end() == 2
    lines = [line for line in child.output.splitlines() if "INFO" not in line]
    assert len(lines) == 1, child.output
    assert "not ready after 0.1 s: nobody (not started), noone (not started)" in lines[0]


def test_faults_come_and_go_while_it_runs(domain: int) -> None:
    from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
    from rcl_interfaces.srv import SetParameters

    def put(peer: Peer, text: str) -> tuple[bool, str]:
        value = ParameterValue(type=ParameterType.PARAMETER_STRING, string_value=text)
        request = SetParameters.Request(parameters=[Parameter(name="inject", value=value)])
        answer = peer.call(SetParameters, "/daq/set_parameters", request).results[0]
        return answer.successful, answer.reason

    command = daq("duration_s:=60.0", "wait_for_subscribers:=1")
    with Process(command, domain) as child, Peer(domain) as peer:
        peer.listen(Truth, Scan)
        peer.find(lambda r: isinstance(r, Scan))
        assert put(peer, "jam:0.5") == (True, "")
        told = peer.find(lambda r: isinstance(r, Truth) and r.fault == "jam")
        assert dict(told.details)["size"] == "0.5"
        for text, words in (
            ("jam:nan", ("'nan'", "no number")),
            ("rust", ("rust", "jam")),
            ("jam:99", ("jam", "99.0", "limits")),
            ("jam:a lot", ("a lot", "no number")),
            ("jam@loop", ("where", "plant")),
        ):
            taken, reason = put(peer, text)
            assert not taken
            assert all(word in reason for word in words), reason
        assert put(peer, "")[0]
        peer.find(
            lambda r: isinstance(r, Truth) and r.fault == "nominal" and r.stamp_ns > told.stamp_ns
        )
        assert put(peer, "actuator_position_bias:0.004@loop")[0]
        inside = peer.find(lambda r: isinstance(r, Truth) and r.fault == "actuator_position_bias")
        assert dict(inside.details)["where"] == "loop"
        assert [r.fault for r in peer.records if isinstance(r, Truth)] == [
            "nominal", "jam", "nominal", "actuator_position_bias"
        ]  # fmt: skip
        status = child.signal(signal.SIGINT, signal.SIGINT)
        assert status == 0


def test_a_bad_scenario_stops_the_node_with_one_line(domain: int) -> None:
    for parameter, word in (
        ("scenario:=rust", "rust"),
        ("fault:=rust", "rust"),
        ("fault_onset_s:=-1.0", "fault_onset_s"),
        ("rate:=0.0", "rate"),
    ):
        with Process(daq(parameter), domain) as child:
            assert child.end() == 2
            assert word in child.output
            assert "Traceback" not in child.output


def test_stamps_are_the_daqs_clock(domain: int) -> None:
    before = time.time_ns()
    with (
        Process(daq("duration_s:=0.5", "wait_for_subscribers:=1"), domain) as child,
        Peer(domain) as peer,
    ):
        peer.listen(Scan)
        first = peer.find(lambda r: isinstance(r, Scan))
        assert child.end() == 0
    assert before < first.stamp_ns < time.time_ns()


def test_a_graph_on_simulated_time_goes_by_the_stands_clock(domain: int) -> None:
    """The stand keeps its own epoch, and a node that uses simulated time tells that time."""
    observer = node("observer", "-p", "use_sim_time:=true")
    stand = daq("publish_clock:=true", "rate:=4.0", "wait_for_subscribers:=2")
    with Peer(domain) as peer:
        peer.bus.subscribe(Scan, peer.records.append)
        with Process(observer, domain), Process(stand, domain):
            peer.bus.subscribe(Health, peer.records.append)
            told = peer.find(
                lambda r: (
                    isinstance(r, Health)
                    and r.node == "observer"
                    and r.stamp_ns > (DEFAULT_EPOCH_S + 2) * NANOSECONDS
                )
            )
    scans = [record.stamp_ns for record in peer.records if isinstance(record, Scan)]
    assert abs(scans[0] - DEFAULT_EPOCH_S * NANOSECONDS) < NANOSECONDS
    assert scans[0] < told.stamp_ns < scans[-1] + NANOSECONDS


@pytest.mark.in_turn(2)
def test_the_stand_follows_what_the_data_bus_commands(domain: int) -> None:
    """Positions of a topic move the stand; what is out of reach is refused, silence is told."""
    from std_msgs.msg import Float64

    command = daq("scenario:=hold", "duration_s:=60.0", "wait_for_subscribers:=1",
                  "command_topic:=bus/aileron", "command_silent_s:=0.5")  # fmt: skip
    with Process(command, domain) as child, Peer(domain) as peer:
        peer.listen(Scan, Health)
        start = peer.find(lambda r: isinstance(r, Scan)).value("load_position")
        peer.find(lambda r: isinstance(r, Health) and "no position command yet" in r.message)
        sender = peer.node.create_publisher(Float64, "bus/aileron", 10)
        peer.until(lambda: sender.get_subscription_count() == 1)
        for wanted in (math.nan, 0.2, start + 0.01):
            sender.publish(Float64(data=wanted))
        peer.find(
            lambda r: isinstance(r, Scan) and abs(r.value("load_position") - start - 0.01) < 1e-3
        )
        told = peer.find(lambda r: isinstance(r, Health) and "s: the last one is held" in r.message)
        assert child.signal(signal.SIGINT, signal.SIGINT) == 0
    assert dict(told.values)["position_commands/taken"] == "1"
    assert dict(told.values)["position_commands/refused"] == "2"
    speeds = np.abs(np.diff([r.value("commanded_position") for r in peer.records
                             if isinstance(r, Scan)])) / 0.01  # fmt: skip
    assert 0.05 < speeds.max() < 0.12
