"""Records from one bus to another over DDS."""

from __future__ import annotations

from support.live import Peer

from flea_diag.wire.records import NEVER_NS, AmbiguityGroup, Outcome


def group(seq: int) -> AmbiguityGroup:
    return AmbiguityGroup(
        stamp_ns=seq,
        outcome=Outcome.NOMINAL,
        episode=0,
        step=0,
        seq=seq,
        members=(),
        dropped=(),
        detected_stamp_ns=NEVER_NS,
        words="",
        calibration_sha256="",
        source="live",
    )


def test_changes_of_a_latched_record_that_come_in_a_burst_all_arrive(domain: int) -> None:
    with Peer(domain, name="writer") as writer, Peer(domain, name="reader") as reader:
        writer.bus.advertise(AmbiguityGroup)
        reader.listen(AmbiguityGroup)
        assert writer.heard(AmbiguityGroup)
        for seq in range(20):
            writer.bus.publish(group(seq))
        reader.until(lambda: len(reader.records) >= 20)
        assert [record.seq for record in reader.records] == list(range(20))


def test_who_joins_late_gets_the_last_of_a_latched_record_alone(domain: int) -> None:
    with Peer(domain, name="writer") as writer, Peer(domain, name="reader") as reader:
        for seq in range(3):
            writer.bus.publish(group(seq))
        reader.listen(AmbiguityGroup)
        reader.find(lambda record: True)
        assert [record.seq for record in reader.records] == [2]
