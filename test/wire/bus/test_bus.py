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
