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

"""The managed life cycle of a node, by the services that ROS 2 defines for it."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.live import Peer, Process, node, toy

from flea_diag.configuration.calibrations import load_calibration
from flea_diag.configuration.stand import load_stand
from flea_diag.wire.bags.bag import BagReader
from flea_diag.wire.records import (
    AmbiguityGroup,
    ChannelInfo,
    ChannelTable,
    Health,
    Residual,
    Scan,
)

LIMIT_S = 20.0
PRIMARY = {1: "unconfigured", 2: "inactive", 3: "active", 4: "finalized"}
"""Numbers and names of the design article on managed nodes."""


class Managed:
    """A toy node, and a peer that commands it and sends it scans."""

    def __init__(self, process: Process, peer: Peer) -> None:
        self.process, self.peer, self.stamp_ns = process, peer, 10**12

    def scan(self, current: float) -> None:
        """Send one scan."""
        self.stamp_ns += 10_000_000
        self.peer.bus.publish(Scan(self.stamp_ns, ("motor_current",), (current,)))

    def seen(self) -> list[float]:
        """How many scans the stage said each time that it had seen since it was built.

        Not what it lets go when no scan comes, which a slow machine may make of any pause.
        """
        residuals = (r for r in self.peer.records if isinstance(r, Residual))
        return [r.values[0] for r in residuals if r.names == ("seen",)]

    def refused(self, transition: str) -> bool:
        """Whether a transition does not succeed."""
        return not self.peer.change_state("toy", transition)


@pytest.fixture
def managed(domain: int) -> Iterator[Managed]:
    """A toy that waits for its transitions."""
    with Process(toy("-p", "autostart:=false"), domain) as process, Peer(domain) as peer:
        for kind in (Health, AmbiguityGroup, Residual):
            peer.bus.subscribe(kind, peer.records.append)
        yield Managed(process, peer)


def configured(managed: Managed) -> None:
    assert managed.peer.change_state("toy", "configure")
    peer = managed.peer
    assert peer.heard(Scan)
    peer.until(lambda: all(map(peer.node.count_publishers, ("residual", "ambiguity_group"))))


def test_a_node_starts_itself_unless_it_is_told_not_to(domain: int) -> None:
    with Process(toy(), domain), Peer(domain) as peer:
        states = peer.bus.node_states(("toy",))
        peer.until(lambda: states.of("toy") == "active", LIMIT_S)
        assert peer.state("toy") == "active"
    with Process(toy("-p", "autostart:=false"), domain), Peer(domain) as peer:
        assert peer.state("toy") == "unconfigured"


def test_states_and_transitions_are_those_of_ros(managed: Managed) -> None:
    from lifecycle_msgs.srv import GetAvailableStates, GetAvailableTransitions

    states = managed.peer.call(
        GetAvailableStates, "/toy/get_available_states", GetAvailableStates.Request()
    ).available_states
    assert {s.id: s.label for s in states if s.id in PRIMARY} == PRIMARY
    possible = managed.peer.call(
        GetAvailableTransitions, "/toy/get_available_transitions", GetAvailableTransitions.Request()
    ).available_transitions
    assert {each.transition.label for each in possible} == {"configure", "shutdown"}


def test_each_state_is_latched_and_on_diagnostics_and_an_event(managed: Managed) -> None:
    from lifecycle_msgs.msg import TransitionEvent

    events = []
    managed.peer.node.create_subscription(
        TransitionEvent, "/toy/transition_event", lambda e: events.append(e.goal_state.label), 10
    )
    managed.peer.until(lambda: managed.peer.node.count_publishers("/toy/transition_event") > 0)
    managed.peer.find(lambda r: isinstance(r, Health), LIMIT_S)  # connected: none will be missed
    configured(managed)
    assert managed.peer.change_state("toy", "activate")
    for state in ("unconfigured", "configuring", "inactive", "active"):
        managed.peer.find(
            lambda r, s=state: isinstance(r, Health) and dict(r.values).get("state") == s, LIMIT_S
        )
    late = managed.peer.bus.node_states(("toy",))  # joins when all has been said
    managed.peer.until(lambda: late.of("toy") == "active", LIMIT_S)
    managed.peer.until(lambda: events[-1:] == ["active"], LIMIT_S)
    assert events == ["configuring", "inactive", "activating", "active"]


def test_records_are_judged_only_while_the_node_is_active(managed: Managed) -> None:
    peer = managed.peer
    configured(managed)
    managed.scan(9.0)
    assert peer.acknowledged(Scan)
    assert peer.change_state("toy", "activate")
    managed.scan(9.0)
    first = peer.find(lambda r: isinstance(r, AmbiguityGroup), LIMIT_S)
    assert first.outcome.value == "ISOLATED"
    peer.until(lambda: managed.seen() == [1.0], LIMIT_S)

    assert peer.change_state("toy", "deactivate")
    managed.process.wait_for("deactivated: no record is judged", LIMIT_S)
    stale = peer.find(lambda r: isinstance(r, AmbiguityGroup) and r.stale, LIMIT_S)
    published = sum(isinstance(r, AmbiguityGroup) for r in peer.records)
    reported = len(peer.records)
    managed.scan(1.0)
    peer.until(
        lambda: sum(isinstance(r, Health) for r in peer.records[reported:]) >= 3, LIMIT_S
    )  # 3 s: the verdict of an active node would have been repeated
    assert sum(isinstance(r, AmbiguityGroup) for r in peer.records) == published
    assert [member.fault for member in stale.members] == ["jam"]
    assert managed.seen() == [1.0]

    assert peer.change_state("toy", "activate")
    managed.scan(9.0)
    peer.until(lambda: managed.seen() == [1.0, 2.0], LIMIT_S)  # the same stage goes on


def test_cleanup_drops_the_stage_and_configure_builds_one_of_the_present_parameters(
    managed: Managed,
) -> None:
    from rcl_interfaces.srv import SetParameters
    from rclpy.parameter import Parameter

    peer = managed.peer
    for _ in range(2):  # nothing of the first life is in the way of the second
        configured(managed)
        assert peer.change_state("toy", "activate")
        managed.scan(9.0)
        group = peer.find(lambda r: isinstance(r, AmbiguityGroup) and r.members, LIMIT_S)
        peer.until(lambda: managed.seen() == [1.0], LIMIT_S)
        assert peer.change_state("toy", "deactivate")
        assert peer.change_state("toy", "cleanup")
        peer.until(lambda: peer.bus.subscribers(Scan) == 0, LIMIT_S)
        peer.until(lambda: not peer.bus.publishers.matched(Scan), LIMIT_S)
        parameter = Parameter("fault", value="spall").to_parameter_msg()
        request = SetParameters.Request(parameters=[parameter])
        assert peer.call(SetParameters, "/toy/set_parameters", request).results[0].successful
        fault = group.members[0].fault
        peer.records.clear()
    assert fault == "spall"


def test_latched_inputs_survive_configure_cleanup_and_deactivation(domain: int) -> None:
    """What was latched while the node was not active is what it begins with."""
    known = load_calibration(load_stand().calibration).channels
    command = node("diagnoser", "-p", "autostart:=false", "-p", "memory:=none")
    with Process(command, domain), Peer(domain) as peer:
        peer.bus.subscribe(AmbiguityGroup, peer.records.append)
        stamp_ns, units = 10**18, dict.fromkeys(known, "") | {"motor_current": "mA"}

        def say_units() -> None:
            rows = (ChannelInfo(name, unit, -1e4, 1e4, 100.0) for name, unit in units.items())
            peer.bus.publish(ChannelTable(stamp_ns, "stand", tuple(rows)))

        def verdict_holds(words: str) -> bool:
            nonlocal stamp_ns
            stamp_ns += 10_000_000
            peer.bus.publish(Scan(stamp_ns, tuple(known), (0.0,) * len(known)))
            return any(isinstance(r, AmbiguityGroup) and words in r.words for r in peer.records)

        say_units()
        for _ in range(2):
            assert peer.change_state("diagnoser", "configure")
            assert peer.heard(Scan, ChannelTable)
            assert peer.acknowledged(ChannelTable)
            assert peer.change_state("diagnoser", "activate")
            peer.until(lambda: verdict_holds("motor_current"), LIMIT_S)
            assert peer.change_state("diagnoser", "deactivate")
            assert peer.change_state("diagnoser", "cleanup")
            peer.records.clear()


def test_the_bag_of_a_recorder_that_is_activated_later_has_what_was_latched(
    domain: int, tmp_path: Path
) -> None:
    bag = tmp_path / "bag"
    given = (f"directory:={bag}", "autostart:=false", "clips:=false")
    command = node("recorder", *(part for each in given for part in ("-p", each)))
    with Process(command, domain) as process, Peer(domain) as peer:
        peer.bus.publish(ChannelTable(1, "stand", ()))
        assert peer.change_state("recorder", "configure")
        assert peer.heard(ChannelTable)
        assert peer.acknowledged(ChannelTable)
        peer.listen(Health)
        assert peer.change_state("recorder", "activate")
        # Its own health is recorded, too: how many messages there are says nothing of the table.
        taken = "sensors/channels/received", "1"
        peer.find(lambda record: isinstance(record, Health) and taken in record.values)
        assert process.signal(signal.SIGTERM) == 0
    assert [record for _, record in BagReader(bag).records((ChannelTable,))] == [
        ChannelTable(1, "stand", ())
    ]


def test_what_is_not_possible_is_refused_in_words(managed: Managed) -> None:
    assert managed.refused("activate")
    words = "transition 'activate' refused in state unconfigured: possible are configure, shutdown"
    managed.process.wait_for(words, LIMIT_S)
    assert managed.refused("transition_success")
    assert managed.refused("fly")
    assert managed.peer.state("toy") == "unconfigured"


def test_shutdown_ends_the_node_with_status_0(managed: Managed) -> None:
    configured(managed)
    assert managed.peer.change_state("toy", "activate")
    assert managed.peer.change_state("toy", "shutdown")
    assert managed.process.end() == 0
    assert "Traceback" not in managed.process.output


def test_a_configuration_that_fails_leaves_the_node_unconfigured(domain: int) -> None:
    """Started by itself the node ends with the same line (``test_program``)."""
    command = node("observer", "-p", "autostart:=false", "-p", "calibration:=none")
    with Process(command, domain) as process, Peer(domain) as peer:
        peer.until(lambda: peer.node.count_publishers("/observer/state") > 0, LIMIT_S)
        assert not peer.change_state("observer", "configure")
        failed = process.wait_for("transition configure failed", LIMIT_S)
        assert "none: no such calibration: make it with flea calibrate" in failed
        assert peer.state("observer") == "unconfigured"
        assert process.signal(signal.SIGINT) == 0


def test_a_configuration_that_fails_ends_a_node_that_starts_itself_with_one_line(
    domain: int,
) -> None:
    command = node("observer", "-p", "calibration:=none")
    with Process(command, domain) as process:
        assert process.end() == 2
    assert process.output.startswith("flea_diag: ")
    assert "none: no such calibration: make it with flea calibrate" in process.output
    assert len(process.output.splitlines()) == 1, process.output


def test_parameters_are_checked_without_a_start(domain: int) -> None:
    sound = [*toy()[:2], "--check"]
    with Process([*sound, "--ros-args", "-p", "serial:=good"], domain) as process:
        assert (process.end(), process.output) == (0, "")
    for bad, words in (("serial:=bad", "cannot be built"), ("limit_a:=41.0", "above its limit")):
        with Process([*sound, "--ros-args", "-p", bad], domain) as process:
            assert process.end() == 2
        assert words in process.output
        assert len(process.output.splitlines()) == 1, process.output


def test_a_listener_that_asks_for_more_than_is_offered_does_not_hold_up_a_source(
    domain: int,
) -> None:
    from rclpy.qos import DurabilityPolicy, QoSProfile
    from sensor_msgs.msg import JointState

    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    with Peer(domain, name="source") as source, Peer(domain, name="other") as other:
        other.node.create_subscription(JointState, "sensors/slow", print, latched)
        other.bus.subscribe(Scan, other.records.append)
        source.until(lambda: source.bus.subscribers(Scan) == 2, LIMIT_S)
        source.until(lambda: source.bus.publishers.connected(Scan), LIMIT_S)
        assert source.bus.publishers.matched(Scan) == 1


def test_the_services_answer_while_the_node_compiles(domain: int) -> None:
    with Process(toy("-p", "busy:=true"), domain) as process, Peer(domain) as peer:
        process.wait_for("warming up", LIMIT_S)
        assert peer.state("toy") == "configuring"
        assert not peer.change_state("toy", "configure")
        assert process.signal(signal.SIGTERM) == 0
    assert "Traceback" not in process.output


def test_what_is_fixed_at_configuration_can_be_set_before_it_and_after_cleanup(
    managed: Managed,
) -> None:
    """As `ros2 param set` does for a node that waits for its manager; the stage is built of it."""
    from rcl_interfaces.srv import SetParameters
    from rclpy.parameter import Parameter

    peer = managed.peer

    def refusal(value: str) -> str:
        request = SetParameters.Request(
            parameters=[Parameter("serial", value=value).to_parameter_msg()]
        )
        return str(peer.call(SetParameters, "/toy/set_parameters", request).results[0].reason)

    assert refusal("bad") == ""
    assert refusal("EMA-7") == ""
    assert managed.peer.change_state("toy", "configure")
    assert "serial is read-only once the node is configured" in refusal("EMA-8")
    assert managed.peer.change_state("toy", "cleanup")
    assert refusal("EMA-8") == ""


def test_a_clock_that_does_not_come_and_a_second_node_of_the_name_are_warned_of(
    domain: int,
) -> None:
    with (
        Process(toy("-p", "use_sim_time:=true"), domain) as process,
        Process(toy(), domain) as other,
    ):
        process.wait_for("use_sim_time is true and nothing comes on /clock", LIMIT_S)
        for each in (process, other):
            each.wait_for("another node is called /toy, too", LIMIT_S)
            assert each.output.count("another node") == 1


def test_a_node_that_is_not_ready_says_every_few_seconds_what_it_does(domain: int) -> None:
    """It is busy in a thread of its own, and its services answer meanwhile."""
    from lifecycle_msgs.srv import GetState

    with Process(toy("-p", "busy:=true"), domain) as process, Peer(domain) as peer:
        process.wait_for("starting for 5 s: reading files", LIMIT_S)
        answer = peer.call(GetState, "/toy/get_state", GetState.Request())
        assert answer.current_state.label == "configuring"
        process.child.kill()
