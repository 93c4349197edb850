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

"""Bags: rosbag2's layout, rosbags as the independent reader, death of the writer, damage."""

from __future__ import annotations

import signal
import struct
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from support import examples

from flea_diag.errors import RecordingError
from flea_diag.wire import records as r
from flea_diag.wire.bags.bag import BagReader, BagWriter, read_bag
from flea_diag.wire.messages.codec import encode
from flea_diag.wire.topics import JOINT_STATE, TOPIC_OF

EPOCH_NS = 1_283_500_000 * 10**9
PERIOD_NS = 10_000_000


def scan(number: int) -> r.Scan:
    return r.Scan(EPOCH_NS + number * PERIOD_NS, ("motor_current",), (float(number),))


def write_scans(directory: Path, count: int = 300, **options: Any) -> list[r.Scan]:
    scans = [scan(number) for number in range(count)]
    with BagWriter(directory, **options) as bag:
        for record in scans:
            bag.write(record)
    return scans


def records_of(directory: Path, **options: Any) -> list[r.Record]:
    return [record for _, record in read_bag(directory, **options)]


def test_what_is_written_is_read_in_log_order(tmp_path: Path) -> None:
    truth = r.Truth(EPOCH_NS, "jam", EPOCH_NS, (("name", "t+1"),))
    block = r.VibrationBlock(EPOCH_NS + 5, ("x",), 1, bytes(8))
    with BagWriter(tmp_path / "run") as bag:
        bag.write(scan(1))
        bag.write(scan(0))
        bag.write(truth)
        bag.write(block)
    assert list(read_bag(tmp_path / "run")) == [
        (EPOCH_NS, scan(0)),
        (EPOCH_NS, truth),
        (EPOCH_NS + 5, block),
        (EPOCH_NS + PERIOD_NS, scan(1)),
    ]
    assert records_of(tmp_path / "run", types=[r.Truth]) == [truth]


def test_log_time_orders_and_stamp_is_kept(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "run") as bag:
        bag.write(scan(5), log_ns=EPOCH_NS)
        bag.write(scan(0), log_ns=EPOCH_NS + 1)
    assert records_of(tmp_path / "run") == [scan(5), scan(0)]


def test_rosbags_opens_it_and_metadata_say_what_is_in_it(tmp_path: Path) -> None:
    rosbag2 = pytest.importorskip("rosbags.rosbag2", reason="rosbags is not installed")
    scans = write_scans(tmp_path / "run", 250)
    with rosbag2.Reader(tmp_path / "run") as bag:
        (connection,) = bag.connections
        assert (connection.topic, connection.msgtype) == ("/sensors/slow", JOINT_STATE)
        assert bag.message_count == 250
        assert bag.start_time == EPOCH_NS
        assert bag.duration == 249 * PERIOD_NS + 1
        assert bag.ros_distro == "jazzy"
        assert [bytes(data) for _, _, data in bag.messages()] == [encode(s) for s in scans]
        (qos,) = connection.ext.offered_qos_profiles
        assert (qos.reliability.name, qos.durability.name) == ("RELIABLE", "VOLATILE")
        assert qos.depth == 100
    described = yaml.safe_load((tmp_path / "run" / "metadata.yaml").read_text())
    described = described["rosbag2_bagfile_information"]
    assert described["version"] == 9
    assert described["storage_identifier"] == "mcap"
    assert described["relative_file_paths"] == ["run_0.mcap"]
    topic = described["topics_with_message_count"][0]
    assert topic["message_count"] == 250
    # The hash that ROS 2 Jazzy itself prints for `ros2 topic info -v` on a JointState.
    assert topic["topic_metadata"]["type_description_hash"] == (
        "RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e"
    )


def test_mcap_library_finds_profile_schema_channel_and_attachment(tmp_path: Path) -> None:
    reader = pytest.importorskip("mcap.reader", reason="mcap is not installed")
    with BagWriter(tmp_path / "run") as bag:
        bag.write(scan(0), log_ns=EPOCH_NS + 77)
        bag.attach("calibration.yaml", "gain: 1\n")
    with (tmp_path / "run" / "run_0.mcap").open("rb") as stream:
        mcap = reader.make_reader(stream, validate_crcs=True)
        assert mcap.get_header().profile == "ros2"
        ((schema, channel, message),) = list(mcap.iter_messages())
        assert (schema.name, schema.encoding) == (JOINT_STATE, "ros2msg")
        assert b"MSG: builtin_interfaces/Time" in schema.data
        assert channel.message_encoding == "cdr"
        assert channel.metadata["topic_type_hash"].startswith("RIHS01_")
        assert yaml.safe_load(channel.metadata["offered_qos_profiles"])[0]["depth"] == 100
        assert (message.publish_time, message.log_time) == (EPOCH_NS, EPOCH_NS + 77)
        (attachment,) = mcap.iter_attachments()
        assert attachment.data == b"gain: 1\n"
        (metadata,) = mcap.iter_metadata()
        assert metadata.name == "rosbag2"
    assert BagReader(tmp_path / "run").attachments == {"calibration.yaml": "gain: 1\n"}


def test_equal_records_give_equal_bytes(tmp_path: Path) -> None:
    for name in ("a", "b"):
        write_scans(tmp_path / name / "run", whole_every_s=None)
    files = [tmp_path / name / "run" / "run_0.mcap" for name in ("a", "b")]
    assert files[0].read_bytes() == files[1].read_bytes()


KILLED = """
import sys
from flea_diag.wire.bags.bag import BagWriter
from flea_diag.wire.records import Scan
bag = BagWriter(sys.argv[1], whole_every_s=None)
for number in range(10**9):
    bag.write(Scan(1283500000 * 10**9 + number * 10**7, ("motor_current",), (float(number),)))
    if number % 500 == 499:
        bag.make_whole()
        print(number + 1, flush=True)
"""


def test_kill_9_loses_nothing_that_was_made_whole(tmp_path: Path) -> None:
    rosbag2 = pytest.importorskip("rosbags.rosbag2", reason="rosbags is not installed")
    directory = tmp_path / "run"
    process = subprocess.Popen(
        [sys.executable, "-c", KILLED, str(directory)],
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    announced = [int(process.stdout.readline()) for _ in range(4)][-1]
    process.send_signal(signal.SIGKILL)
    process.communicate()
    losses: list[str] = []
    found = records_of(directory, losses=losses)
    assert len(found) >= announced == 2000
    assert found == [scan(number) for number in range(len(found))]
    assert losses == []
    with rosbag2.Reader(directory) as bag:
        assert bag.message_count >= announced


def test_whole_by_the_clock_of_the_wall(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "run", whole_every_s=0.0) as bag:
        assert not (tmp_path / "run" / "metadata.yaml").exists()
        bag.write(scan(0))
        assert records_of(tmp_path / "run") == [scan(0)]


def test_no_metadata_without_topics(tmp_path: Path) -> None:
    bag = BagWriter(tmp_path / "run")
    bag.make_whole()
    assert not (tmp_path / "run" / "metadata.yaml").exists()
    bag.close()
    assert not (tmp_path / "run").exists()


def test_two_stands_in_one_bag(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "run", namespace="stand_b") as bag:
        bag.write(scan(1))
        bag.write_raw("/stand_a/sensors/slow", encode(scan(0)), EPOCH_NS)
        bag.write(r.Health(EPOCH_NS, "observer", r.Level.OK, "fine"))
    assert sorted(BagReader(tmp_path / "run").topics) == [
        "/diagnostics",
        "/stand_a/sensors/slow",
        "/stand_b/sensors/slow",
    ]
    assert records_of(tmp_path / "run", namespace="stand_b", types=[r.Scan]) == [scan(1)]
    assert len(records_of(tmp_path / "run", namespace="/stand_a")) == 2
    with pytest.raises(RecordingError, match="several stands: choose one of /stand_a, /stand_b"):
        records_of(tmp_path / "run")
    with pytest.raises(RecordingError, match="no namespace 'c'"):
        records_of(tmp_path / "run", namespace="c")


@pytest.mark.parametrize(
    ("write", "words"),
    [
        (
            lambda bag: bag.write_raw("/odom", b"", 0),
            "'/odom' is not listed in flea_diag.wire.topics",
        ),
        (lambda bag: bag.write(r.Scan(-1, (), ())), "before 1970"),
    ],
)
def test_what_does_not_belong_in_a_bag_is_refused(tmp_path: Path, write: Any, words: str) -> None:
    bag = BagWriter(tmp_path / "run")
    with pytest.raises(RecordingError, match=words):
        write(bag)
    bag.close()


def test_a_folder_in_use_is_refused(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(RecordingError, match="is not empty"):
        BagWriter(tmp_path)
    with pytest.raises(RecordingError, match="cannot write bag"):
        BagWriter(tmp_path / "notes.txt")
    with pytest.raises(RecordingError, match="namespace '1a' is not a ROS name"):
        BagWriter(tmp_path / "run", namespace="1a")


def test_no_bag_at_all_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="does not exist"):
        records_of(tmp_path / "nowhere")
    with pytest.raises(RecordingError, match="is not a bag"):
        records_of(tmp_path)
    (tmp_path / "text.mcap").write_text("hello, this is text")
    with pytest.raises(RecordingError, match="is not an MCAP file"):
        records_of(tmp_path)


def foreign_bag(directory: Path, plugin: str, messages: dict[str, tuple[str, list[bytes]]]) -> Path:
    """A bag written by rosbags: topic -> (type, CDR messages)."""
    rosbag2 = pytest.importorskip("rosbags.rosbag2", reason="rosbags is not installed")
    typesys = pytest.importorskip("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    plugin = rosbag2.StoragePlugin[plugin]
    with rosbag2.Writer(directory, version=9, storage_plugin=plugin) as bag:
        for topic, (kind, contents) in messages.items():
            connection = bag.add_connection(topic, kind, typestore=store)
            for number, data in enumerate(contents):
                bag.write(connection, EPOCH_NS + number, data)
    return directory


@pytest.mark.parametrize("plugin", ["MCAP", "SQLITE3"])
def test_bags_of_others_are_read(tmp_path: Path, plugin: str) -> None:
    data = [encode(scan(number)) for number in range(20)]
    image = {"/camera": ("std_msgs/msg/String", [b"\x00\x01\x00\x00\x01\x00\x00\x00\x00"])}
    bag = foreign_bag(tmp_path / "run", plugin, {"/sensors/slow": (JOINT_STATE, data), **image})
    assert records_of(bag) == [scan(number) for number in range(20)]


def test_a_foreign_bag_says_what_is_missing(tmp_path: Path) -> None:
    text = b"\x00\x01\x00\x00\x01\x00\x00\x00\x00"
    bag = foreign_bag(tmp_path / "run", "MCAP", {"/sensors/slow": ("std_msgs/msg/String", [text])})
    words = r"no flea_diag topic such as sensors/slow \(sensor_msgs/msg/JointState\)"
    with pytest.raises(RecordingError, match=words):
        records_of(bag)


def test_an_unreadable_message_is_counted_and_passed_over(tmp_path: Path) -> None:
    data = [encode(scan(0)), encode(scan(1))[:30], b"", encode(scan(3))]
    bag = foreign_bag(tmp_path / "run", "MCAP", {"/sensors/slow": (JOINT_STATE, data)})
    losses: list[str] = []
    assert records_of(bag, losses=losses) == [scan(0), scan(3)]
    assert losses[-1] == "/sensors/slow: 2 unreadable messages"


def test_metadata_missing_or_broken_is_survived_and_said(tmp_path: Path) -> None:
    scans = write_scans(tmp_path / "run", 10)
    metadata = tmp_path / "run" / "metadata.yaml"
    for content in ("rosbag2_bagfile_information: [1, 2", "42", "a: " + "[" * 3000):
        metadata.write_text(content)
        losses: list[str] = []
        assert records_of(tmp_path / "run", losses=losses) == scans
        assert losses[0].startswith("metadata.yaml is unreadable")
    metadata.unlink()
    losses = []
    assert records_of(tmp_path / "run", losses=losses) == scans
    assert losses == ["metadata.yaml is missing"]


@pytest.fixture(scope="module")
def whole_file(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    directory = tmp_path_factory.mktemp("whole") / "run"
    with BagWriter(directory, whole_every_s=None) as bag:
        for number in range(60):
            bag.write(scan(number))
            if number % 20 == 19:
                bag.make_whole()
    return (directory / "run_0.mcap").read_bytes()


def read_or_refusal(file: Path) -> tuple[list[r.Record], list[str]]:
    """Records and losses of a damaged file; a refusal counts as a loss."""
    losses: list[str] = []
    try:
        return records_of(file, losses=losses), losses
    except RecordingError as error:
        return [], [str(error)]


@pytest.mark.in_turn(2)
def test_a_file_cut_anywhere_is_read_as_far_as_it_is_whole(
    tmp_path: Path, whole_file: bytes
) -> None:
    file = tmp_path / "cut.mcap"
    counts = []
    for size in (*range(8, len(whole_file), 5), len(whole_file)):
        file.write_bytes(whole_file[:size])
        found, losses = read_or_refusal(file)
        # From the footer's last byte on, nothing is lost any more.
        assert losses or size >= len(whole_file) - 8
        assert found == [scan(number) for number in range(len(found))]
        counts.append(len(found))
    assert counts == sorted(counts)
    assert sorted(set(counts)) == [0, 20, 40, 60]


def test_half_of_a_large_chunk_is_saved(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "run", whole_every_s=None) as bag:
        for number in range(6000):
            bag.write(r.Scan(scan(number).stamp_ns, ("a",), (number * 0.1234567,)))
    file = tmp_path / "run" / "run_0.mcap"
    chunk = file.read_bytes()[: file.stat().st_size // 3]
    assert chunk.count(b"zstd") == 1
    (tmp_path / "cut.mcap").write_bytes(chunk)
    losses: list[str] = []
    found = records_of(tmp_path / "cut.mcap", losses=losses)
    assert 1000 < len(found) < 6000
    assert [record.values[0] for record in found] == [k * 0.1234567 for k in range(len(found))]
    assert "no footer" in losses[0]


@settings(
    max_examples=examples(150),
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(data=st.data())
def test_a_damaged_file_never_crashes_the_reader(
    tmp_path: Path, whole_file: bytes, data: st.DataObject
) -> None:
    content = bytearray(whole_file)
    for _ in range(data.draw(st.integers(1, 6))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    file = tmp_path / "damaged.mcap"
    file.write_bytes(content)
    found, losses = read_or_refusal(file)
    assert all(type(record) in TOPIC_OF for record in found)
    assert not any("\n" in loss for loss in losses)


def test_a_chunk_that_claims_to_unpack_to_terabytes_is_refused(tmp_path: Path) -> None:
    zstandard = pytest.importorskip("zstandard", reason="zstandard is not installed")
    bomb = zstandard.compress(bytes(64 << 20))
    losses = []
    for claimed in (1 << 40, 100):
        head = struct.pack("<QQQI", 0, 1, claimed, 0) + struct.pack("<I", 4) + b"zstd"
        body = head + struct.pack("<Q", len(bomb)) + bomb
        record = struct.pack("<BQ", 6, len(body)) + body
        (tmp_path / "bomb.mcap").write_bytes(b"\x89MCAP0\r\n" + record)
        with pytest.raises(RecordingError, match="contains no flea_diag topic"):
            records_of(tmp_path / "bomb.mcap", losses=losses)


def test_a_packed_bag_without_its_unpacker_names_the_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_scans(tmp_path / "run")
    monkeypatch.setitem(sys.modules, "zstandard", None)
    with pytest.raises(RecordingError, match="pip install mcap"):
        records_of(tmp_path / "run")
