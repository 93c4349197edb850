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

"""Findings of a check of a bag: its rosbag2 layout, its metadata and every message."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from flea_diag.core.residuals.channel_units import UNITS, unit_refusal
from flea_diag.errors import RecordingError, WireError, shown
from flea_diag.tools.bags.recovery import mcap_files, merged
from flea_diag.wire.bags import bag_layout as layout
from flea_diag.wire.bags.bag_description import described
from flea_diag.wire.bags.mcap_message import Channel, McapMessage
from flea_diag.wire.bags.mcap_scan import McapScan
from flea_diag.wire.messages.codec import decode
from flea_diag.wire.records import ChannelTable
from flea_diag.wire.topics import TOPIC_OF

TABLE_TOPIC = TOPIC_OF[ChannelTable].name
EPOCH_NS = 946_684_800_000_000_000
"""Start of the year 2000: earlier stamps are not wall-clock times."""


class BagFinding(NamedTuple):
    """An error, or a note (``error`` false)."""

    error: bool
    words: str


def check(bag: Path, units: Mapping[str, str] = UNITS) -> list[BagFinding]:
    """Errors of a bag, and notes on it; ``units`` are those of the channels of its stand.

    Raises
    ------
    RecordingError
        There is no MCAP bag.
    """
    if not bag.is_dir():
        raise RecordingError(f"{bag} is not a folder: a bag is a folder with an .mcap file")
    scans = [McapScan(file) for file in mcap_files(bag)]
    counts: Counter[str] = Counter()
    findings = [*_messages(scans, counts, units), *(f for scan in scans for f in _file(scan))]
    return [*_metadata(bag, scans, counts), *findings]


def _file(scan: McapScan) -> Iterator[BagFinding]:
    name = scan.path.name
    if scan.profile != "ros2":
        yield BagFinding(
            True, f"{name}: profile {shown(scan.profile)} in the header, must be 'ros2'"
        )
    for loss in scan.losses:
        yield BagFinding(True, loss)
    if not scan.indexed:
        yield BagFinding(False, f"{name}: no summary (recorder killed): add one with flea recover")
    for channel in scan.channels.values():
        yield from _channel(channel)


def _channel(channel: Channel) -> Iterator[BagFinding]:
    known = dict(channel.metadata)
    if channel.encoding != "cdr":
        yield BagFinding(
            True, f"{channel.topic}: encoding {shown(channel.encoding)}, must be 'cdr'"
        )
    if channel.schema.encoding not in ("ros2msg", "ros2idl"):
        encoding = channel.schema.encoding
        yield BagFinding(
            True, f"{channel.topic}: schema encoding {shown(encoding)}, must be 'ros2msg'"
        )
    if "offered_qos_profiles" not in known:
        yield BagFinding(True, f"{channel.topic}: no offered_qos_profiles on its channel")
    ours = layout.split_name(channel.topic)
    if ours is None:
        yield BagFinding(False, f"{channel.topic}: not a flea_diag topic")
    elif channel.message != ours[1].message:
        yield BagFinding(True, f"{channel.topic}: {channel.message}, must be {ours[1].message}")
    else:
        expected = layout.message_type(channel.message).type_hash
        if known.get("topic_type_hash", expected) != expected:
            yield BagFinding(True, f"{channel.topic}: type hash differs from that of ROS 2 Jazzy")


def _messages(
    scans: list[McapScan], counts: Counter[str], units: Mapping[str, str]
) -> Iterator[BagFinding]:
    """Check every message; each kind of error is reported once per topic with its count."""
    wrong: Counter[tuple[str, str]] = Counter()
    tables = 0
    for message in merged(scans):
        counts[message.channel.topic] += 1
        for words in _message(message, units):
            wrong[message.channel.topic, words] += 1
        tables += message.channel.topic.endswith(TABLE_TOPIC)
    for (topic, words), count in wrong.items():
        yield BagFinding(True, f"{topic}: {words} ({count} messages)")
    if not tables:
        yield BagFinding(False, f"no {TABLE_TOPIC}: units and signs are unknown")


def _message(message: McapMessage, units: Mapping[str, str]) -> Iterator[str]:
    ours = layout.split_name(message.channel.topic)
    if min(message.log_ns, message.publish_ns) < EPOCH_NS:
        yield "stamp before the year 2000: bags need wall-clock time"
    if ours is None or message.channel.message != ours[1].message:
        return
    try:
        record: Any = decode(ours[1].record, message.data)
    except WireError as error:
        yield f"unreadable: {error}"
        return
    if isinstance(record, ChannelTable):
        refusals = (unit_refusal(row.name, row.unit, units) for row in record.channels)
        yield from filter(None, refusals)
    if record.stamp_ns != message.publish_ns:
        yield "publish time differs from the stamp of acquisition"


def _metadata(bag: Path, scans: list[McapScan], counts: Counter[str]) -> Iterator[BagFinding]:
    lost: list[str] = []
    known = described(bag, lost)
    if known is None:
        yield BagFinding(True, lost[0])
        return
    if known.version != layout.VERSION:
        words = f"version {known.version}, rosbag2 of ROS 2 Jazzy writes {layout.VERSION}"
        yield BagFinding(False, f"{layout.METADATA_FILE}: {words}")
    files = list(known.files)
    present = [scan.path.name for scan in scans]
    if sorted(files) != sorted(present):
        words = f"lists {shown(files)}, the folder has {present}"
        yield BagFinding(True, f"{layout.METADATA_FILE} {words}")
    told = known.counts
    if not told:
        yield BagFinding(True, f"{layout.METADATA_FILE}: no topics (ros2 bag play would hang)")
    for topic in sorted(told.keys() | counts.keys()):
        if told.get(topic, 0) != counts[topic]:
            words = f"{told.get(topic, 0)} messages on {topic}, the files have {counts[topic]}"
            yield BagFinding(True, f"{layout.METADATA_FILE}: {words}")
