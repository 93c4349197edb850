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

"""A stage on the bus, in a process of its own, over DDS."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import TypeGuard

import pytest
from support.live import Peer, Process, toy

from flea_diag.wire.messages.codec import encode
from flea_diag.wire.records import (
    AmbiguityGroup,
    ChannelQuality,
    DataQuality,
    Health,
    Hypotheses,
    Level,
    Outcome,
    Quality,
    Record,
    Residual,
    Scan,
)

PERIOD_NS = 10_000_000


class Stand:
    """Publishes scans with stamps of its own, as a DAQ node would."""

    def __init__(self, peer: Peer) -> None:
        self.peer = peer
        self.stamp_ns = 1_700_000_000 * 10**9

    def scan(self, current: float = 1.0, after_ns: int = PERIOD_NS) -> None:
        self.stamp_ns += after_ns
        self.peer.bus.publish(Scan(self.stamp_ns, ("motor_current",), (current,)))


@pytest.fixture
def stand(domain: int) -> Iterator[Stand]:
    with Process(toy(), domain) as process, Peer(domain) as peer:
        peer.process = process  # type: ignore[attr-defined]
        peer.listen(AmbiguityGroup, Residual, Health)
        assert peer.heard(Scan)
        yield Stand(peer)


def groups(peer: Peer) -> list[AmbiguityGroup]:
    return [record for record in peer.records if isinstance(record, AmbiguityGroup)]


def test_verdict_on_change_repeated_and_stale(stand: Stand) -> None:
    peer = stand.peer
    stand.scan(1.0)
    first = peer.find(lambda r: isinstance(r, AmbiguityGroup))
    assert (first.outcome, first.members, first.stale) == (Outcome.NOMINAL, (), False)
    stand.scan(9.0)
    changed = peer.find(lambda r: getattr(r, "outcome", None) == Outcome.ISOLATED)
    assert [member.fault for member in changed.members] == ["jam"]
    assert changed.stamp_ns == stand.stamp_ns

    stale = peer.find(lambda r: isinstance(r, AmbiguityGroup) and r.stale, limit_s=3.0)
    assert stale.outcome == Outcome.ISOLATED
    assert [member.fault for member in stale.members] == ["jam"]
    held = peer.find(lambda r: isinstance(r, Residual) and r.names == ("held",))
    assert held.values == (2.0,), "what a stage held back goes out when the source stops"
    peer.until(lambda: len(groups(peer)) >= 5)

    stand.scan(9.0)
    peer.until(lambda: not groups(peer)[-1].stale)
    seqs = [group.seq for group in groups(peer)]
    assert seqs == sorted(set(seqs))


def test_hypotheses_once_a_verdict_and_to_a_late_joiner(stand: Stand, domain: int) -> None:
    peer = stand.peer
    peer.listen(Hypotheses)
    stand.scan(1.0)
    peer.find(lambda r: isinstance(r, AmbiguityGroup))
    stand.scan(9.0)
    changed = peer.find(lambda r: isinstance(r, AmbiguityGroup) and r.outcome == Outcome.ISOLATED)
    peer.until(lambda: len(groups(peer)) >= 5)
    found = [record for record in peer.records if isinstance(record, Hypotheses)]
    assert [record.outcome for record in found] == [Outcome.NOMINAL, Outcome.ISOLATED]
    assert changed.summary
    assert found[-1].verdict == changed.verdict
    assert found[-1].members == changed.with_hypotheses(found[-1]).members
    with Peer(domain, name="late") as late:
        late.listen(Hypotheses)
        assert late.find(lambda r: True).outcome == Outcome.ISOLATED


def test_the_log_says_start_readiness_and_each_verdict_once(stand: Stand) -> None:
    peer = stand.peer
    for _ in range(3):
        stand.scan(1.0)
    stand.scan(9.0)
    peer.find(lambda r: getattr(r, "outcome", None) == Outcome.ISOLATED)
    peer.until(lambda: len(groups(peer)) >= 6)  # repeated, and stale by then
    output = peer.process.wait_for("the source has stopped")  # type: ignore[attr-defined]
    lines = [line for line in output.splitlines() if "[toy]" in line]
    said = [line.split("[toy]: ")[1] for line in lines]
    assert said[0].startswith("flea_diag ")
    assert said[0].endswith("stand stand; a toy that says jam")
    assert said[2].startswith("ready after ")
    assert said[2].endswith("listening to /sensors/channels, /sensors/slow")
    assert said[3:5] == ["NOMINAL: nominal", "ISOLATED: isolated"]
    assert [line.split("]")[0] for line in lines[3:5]] == ["[INFO", "[ERROR"]


def test_a_late_joiner_is_right_at_once(stand: Stand, domain: int) -> None:
    stand.scan(9.0)
    stand.peer.find(lambda r: getattr(r, "outcome", None) == Outcome.ISOLATED)
    with Peer(domain, name="late") as late:
        late.listen(AmbiguityGroup)
        # The latched one, and within about a second the repeated one with a higher number.
        assert late.find(lambda r: True).outcome == Outcome.ISOLATED
        late.until(lambda: len({record.seq for record in late.records}) >= 2)


def test_stamps_that_jump_back_start_afresh(stand: Stand) -> None:
    for _ in range(3):
        stand.scan()
    stand.peer.find(lambda r: isinstance(r, Residual) and r.values == (3.0,))
    stand.scan(after_ns=-PERIOD_NS * 3 // 2)  # late by 15 ms: counted, the run goes on
    stand.peer.find(lambda r: isinstance(r, Residual) and r.values == (4.0,))
    stand.peer.records.clear()
    stand.scan(after_ns=-60 * 10**9)
    for _ in range(9):  # one wrong stamp would not do
        stand.scan()
    again = stand.peer.find(lambda r: isinstance(r, Residual))
    assert again.values == (1.0,)
    # One was late, and ten came before the new run was believed; none of them is lost.
    late = ("sensors/slow/late", "11")
    stand.peer.find(lambda r: isinstance(r, Health) and r.node == "toy" and late in r.values)
    stand.peer.find(lambda r: isinstance(r, Residual) and r.values == (10.0,))


def test_a_verdict_stays_stale_until_the_new_run_has_one_of_its_own(stand: Stand) -> None:
    """A player that begins anew after a pause: the first scans say nothing of the run before."""
    peer = stand.peer
    stand.scan(9.0)
    peer.until(lambda: bool(groups(peer)) and groups(peer)[-1].stale)
    old = groups(peer)[-1]
    stand.scan(after_ns=-60 * 10**9)
    for _ in range(8):  # one more, and it would be believed
        stand.scan()
    peer.until(lambda: received(peer) == 10)
    peer.until(lambda: groups(peer)[-1].seq >= old.seq + 3)
    assert all(group.stale for group in groups(peer) if group.seq > old.seq)
    stand.scan(9.0)
    new = peer.find(lambda r: isinstance(r, AmbiguityGroup) and r.stamp_ns < old.stamp_ns)
    assert not new.stale


def is_counted(record: Record) -> TypeGuard[Health]:
    """Whether the node says in it what it was sent; its reports of a transition do not."""
    if not isinstance(record, Health) or record.node != "toy":
        return False
    return "sensors/slow/received" in dict(record.values)


def received(peer: Peer) -> int:
    """Scans that the node says it was sent."""
    counted = [dict(r.values)["sensors/slow/received"] for r in peer.records if is_counted(r)]
    return int(counted[-1]) if counted else 0


def test_a_wrong_stamp_starts_nothing_afresh(stand: Stand) -> None:
    stand.scan()
    stand.scan(after_ns=-60 * 10**9)
    stand.scan(after_ns=60 * 10**9 + PERIOD_NS)
    stand.peer.find(lambda r: isinstance(r, Residual) and r.values == (3.0,))


def test_what_cannot_be_used_is_counted_and_passed_over(stand: Stand) -> None:
    stand.peer.bus.publish_raw(Scan, b"\x00\x01\x00\x00\xff\xff\xff\xff")
    stand.scan(-1.0)
    stand.scan(1.0)
    seen = stand.peer.find(lambda r: isinstance(r, Residual))
    assert seen.values == (2.0,)
    stand.peer.until(lambda: received(stand.peer) == 3)
    values = dict(next(r for r in reversed(stand.peer.records) if is_counted(r)).values)
    assert values["sensors/slow/malformed"] == "1"
    assert values["sensors/slow/refused"] == "1"
    assert float(values["memory_mb"]) > 5
    assert float(values["cpu_percent"]) >= 0


def test_rows_age_and_are_stale_within_a_second_of_a_silent_source(stand: Stand) -> None:
    peer = stand.peer
    peer.listen(DataQuality)
    stand.scan(1.0)
    sound = peer.find(lambda r: isinstance(r, DataQuality))
    assert sound.channels[0].quality is Quality.GOOD
    assert sound.channels[0].read_ns == stand.stamp_ns

    def is_of(record: Record, quality: Quality) -> TypeGuard[DataQuality]:
        return isinstance(record, DataQuality) and record.channels[0].quality is quality

    stale = peer.find(lambda r: is_of(r, Quality.STALE), limit_s=3.0)
    words = re.fullmatch(
        r"the source has stopped, last reading (\d+\.\d) s ago", stale.channels[0].reason
    )
    assert words
    assert 0.5 < float(words[1]) < 1.5
    peer.records.clear()
    stand.scan(1.0)
    peer.find(lambda r: is_of(r, Quality.GOOD))


def test_shares_of_judgement_are_said_again_each_five_seconds_of_the_stream(stand: Stand) -> None:
    peer = stand.peer
    peer.listen(DataQuality)
    stand.scan(1.0)
    first = peer.find(lambda r: isinstance(r, DataQuality))
    assert [row.run for row in first.judged] == [1.0]
    stand.scan(1.0, after_ns=5 * 10**9)

    def renewed(record: Record) -> bool:
        return isinstance(record, DataQuality) and record.judged != first.judged

    # A source that goes on: of one that has fallen silent the shares are of the past.
    for _ in range(100):
        if peer.bus.wait_until(lambda: any(map(renewed, peer.records)), 0.2):
            break
        stand.scan(1.0)
    second = peer.find(renewed)
    assert second.stamp_ns >= first.stamp_ns + 5 * 10**9
    assert second.judged[0].run < 1.0


def test_what_cannot_be_used_is_in_data_quality_by_its_kind(stand: Stand) -> None:
    peer = stand.peer
    peer.listen(DataQuality)
    stand.scan(1.0)
    sound = peer.find(lambda r: isinstance(r, DataQuality))
    assert [row.channel for row in sound.channels] == ["motor_current"]
    now_ns = stand.stamp_ns + PERIOD_NS
    before_1970 = Scan(-5, ("motor_current",), (1.0,))
    twice = Scan(now_ns, ("motor_current",) * 2, (1.0, 2.0))
    for wrong in (before_1970, twice, twice):
        peer.bus.publish_raw(Scan, encode(wrong))
    peer.bus.publish_raw(Scan, b"\x00\x01\x00\x00\xff\xff\xff\xff")
    counted = (("layout", 1), ("names", 2), ("stamp", 1))
    said = peer.find(lambda r: isinstance(r, DataQuality) and r.channels[-1].counters == counted)
    row = said.channels[-1]
    assert (row.channel, row.quality) == ("sensors/slow/malformed", Quality.GOOD)
    assert row.reason == "4 messages skipped: 1 by layout, 2 by names, 1 by stamp"
    assert said.stamp_ns == sound.stamp_ns
    stand.scan(9.0)
    again = peer.find(lambda r: isinstance(r, DataQuality) and r.stamp_ns > sound.stamp_ns)
    assert again.channels[-1] == row


def test_a_best_effort_driver_is_read_with_a_warning_that_names_both(stand: Stand) -> None:
    """As SensorDataQoS; messages of a reliable writer come to the same reader."""
    from rclpy.qos import qos_profile_sensor_data
    from sensor_msgs.msg import JointState

    peer = stand.peer
    driver = peer.node.create_publisher(JointState, "sensors/slow", qos_profile_sensor_data)
    peer.until(lambda: driver.get_subscription_count() > 0)
    warning = peer.process.wait_for("lost messages are not sent again")  # type: ignore[attr-defined]
    assert "/sensors/slow: /peer sends best effort, while this node asks for reliable" in warning
    stand.stamp_ns += PERIOD_NS
    driver.publish(encode(Scan(stand.stamp_ns, ("motor_current",), (9.0,))))
    found = peer.find(lambda r: getattr(r, "outcome", None) == Outcome.ISOLATED)
    assert found.stamp_ns == stand.stamp_ns
    peer.heard(Scan)

    def other_taken() -> bool:
        """Once the first source has been silent for a second."""
        stand.scan(1.0)
        return any(group.outcome == Outcome.NOMINAL for group in groups(peer))

    peer.until(other_taken)


def test_health_says_what_it_waits_for(stand: Stand) -> None:
    waiting = stand.peer.find(lambda r: isinstance(r, Health) and "waiting" in r.message)
    assert waiting.node == "toy"
    assert waiting.level == Level.WARN
    output = stand.peer.process.wait_for("(ros2 topic info)")  # type: ignore[attr-defined]
    # The peer has a publisher of it, and has published nothing.
    assert "no record yet on /sensors/slow, which is published, and brings nothing" in output


def test_reset_closes_the_episode(stand: Stand) -> None:
    from std_srvs.srv import Trigger

    stand.scan(9.0)
    stand.peer.find(lambda r: getattr(r, "outcome", None) == Outcome.ISOLATED)
    answer = stand.peer.call(Trigger, "/toy/reset", Trigger.Request())
    assert answer.success
    stand.peer.find(lambda r: isinstance(r, AmbiguityGroup) and r.stamp_ns == 1)


def test_parameters_are_validated_then_applied(stand: Stand) -> None:
    from rcl_interfaces.srv import DescribeParameters, SetParameters
    from rclpy.parameter import Parameter

    def set_to(name: str, value: object) -> str:
        request = SetParameters.Request()
        request.parameters = [Parameter(name, value=value).to_parameter_msg()]
        result = stand.peer.call(SetParameters, "/toy/set_parameters", request).results[0]
        return "" if result.successful else result.reason

    described = stand.peer.call(
        DescribeParameters,
        "/toy/describe_parameters",
        DescribeParameters.Request(names=["limit_a", "fault", "serial"]),
    ).descriptors
    assert described[0].description == "Current above which [A]"
    assert described[0].floating_point_range[0].to_value == 40.0
    assert described[1].additional_constraints == "jam | spall"
    assert described[2].additional_constraints == "read-only once configured"

    assert "limit" in set_to("limit_a", 41.0) or "range" in set_to("limit_a", 41.0)
    assert "choose one of jam, spall" in set_to("fault", "gremlin")
    assert set_to("limit_a", float("nan"))
    assert set_to("serial", "y")
    assert set_to("fault", "spall") == ""
    stand.scan(9.0)
    group = stand.peer.find(lambda r: isinstance(r, AmbiguityGroup) and r.members)
    assert group.members[0].fault == "spall"


def test_a_namespace_keeps_two_stands_apart(domain: int) -> None:
    with (
        Process(toy("-r", "__ns:=/stand_1"), domain),
        Process(toy("-r", "__ns:=/stand_2"), domain),
        Peer(domain, "/stand_1") as one,
        Peer(domain, "/stand_2") as two,
    ):
        one.listen(AmbiguityGroup)
        two.listen(AmbiguityGroup)
        assert one.heard(Scan)
        assert two.heard(Scan)
        Stand(one).scan(9.0)
        Stand(two).scan(1.0)
        assert one.find(lambda r: True).outcome == Outcome.ISOLATED
        assert two.find(lambda r: True).outcome == Outcome.NOMINAL
        assert {group.outcome for group in groups(one)} == {Outcome.ISOLATED}


def test_a_second_source_is_named_and_not_used(stand: Stand, domain: int) -> None:
    peer = stand.peer
    peer.listen(DataQuality)
    for _ in range(5):
        stand.scan(1.0)
    peer.until(lambda: seen(peer) == 5)
    with Peer(domain, name="second") as second:
        other = Stand(second)
        other.stamp_ns = 1_200_000_000 * 10**9
        assert second.heard(Scan)

        def both() -> bool:
            stand.scan(1.0)
            other.scan(9.0)
            reasons = [r.reason for r in rows(peer) if r.channel == "sensors/slow/second_source"]
            return any(r.startswith("published by /peer, /second: the first") for r in reasons)

        peer.until(both)
    assert {group.outcome for group in groups(peer)} == {Outcome.NOMINAL}


def rows(peer: Peer) -> list[ChannelQuality]:
    return [row for r in peer.records if isinstance(r, DataQuality) for row in r.channels]


def seen(peer: Peer) -> float:
    values = [r.values[0] for r in peer.records if isinstance(r, Residual) and r.names == ("seen",)]
    return max(values, default=0.0)
