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

"""``flea bag check`` and ``flea recover`` on sound, damaged and foreign bags."""

from __future__ import annotations

import resource
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml

from flea_diag.errors import RecordingError
from flea_diag.tools.bags.findings import check
from flea_diag.tools.bags.recovery import recover
from flea_diag.tools.main import main
from flea_diag.wire import records as r
from flea_diag.wire.bags.bag import BagReader, BagWriter, read_bag

EPOCH_NS = 1_283_500_000 * 10**9


def scan(number: int) -> r.Scan:
    return r.Scan(EPOCH_NS + number * 10**7, ("motor_current",), (number * 0.1234567,))


def write(directory: Path, count: int = 300) -> Path:
    with BagWriter(directory, whole_every_s=None) as bag:
        bag.write(r.ChannelTable(EPOCH_NS, "flea", ()))
        for number in range(count):
            bag.write(scan(number))
        bag.attach("calibration.yaml", "gain: 1\n")
    return directory


def errors(bag: Path) -> list[str]:
    return [finding.words for finding in check(bag) if finding.error]


def change_metadata(bag: Path, **changes: Any) -> None:
    file = bag / "metadata.yaml"
    content = yaml.safe_load(file.read_text())
    content["rosbag2_bagfile_information"] |= changes
    file.write_text(yaml.safe_dump(content))


def test_our_own_bags_are_sound(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bag = write(tmp_path / "run")
    assert check(bag) == []
    assert main(["bag", "check", str(bag)]) == 0
    assert capsys.readouterr().out == f"{bag}: sound\n"


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"relative_file_paths": ["other.mcap"]}, "lists ['other.mcap']"),
        ({"topics_with_message_count": []}, "no topics"),
        ({"topics_with_message_count": [{"message_count": 3}]}, "no topics"),
        (
            {
                "topics_with_message_count": [
                    {"topic_metadata": {"name": "/sensors/slow"}, "message_count": 7}
                ]
            },
            "7 messages on /sensors/slow, the files have 300",
        ),
    ],
)
def test_metadata_that_contradicts_the_files(
    tmp_path: Path, changes: dict[str, Any], words: str
) -> None:
    bag = write(tmp_path / "run")
    change_metadata(bag, **changes)
    assert any(words in error for error in errors(bag))


def test_messages_that_are_not_what_they_say(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "run") as bag:
        bag.write_raw("/sensors/slow", b"\x00\x01\x00\x00 nonsense", EPOCH_NS)
        bag.write(r.Scan(5, ("a",), (1.0,)))
        bag.write_raw("/truth", b"", EPOCH_NS)
    found = errors(tmp_path / "run")
    assert any(words.startswith("/sensors/slow: unreadable: Scan: malformed") for words in found)
    assert (
        "/sensors/slow: stamp before the year 2000: bags need wall-clock time (1 messages)" in found
    )
    assert any(words.startswith("/truth: unreadable") for words in found)


def test_a_foreign_bag_is_noted_not_refused(tmp_path: Path) -> None:
    rosbag2 = pytest.importorskip("rosbags.rosbag2", reason="rosbags is not installed")
    typesys = pytest.importorskip("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    plugin = rosbag2.StoragePlugin.MCAP
    with rosbag2.Writer(tmp_path / "run", version=9, storage_plugin=plugin) as bag:
        chatter = bag.add_connection("/chatter", "std_msgs/msg/String", typestore=store)
        bag.write(chatter, EPOCH_NS, b"\x00\x01\x00\x00\x01\x00\x00\x00\x00")
    assert errors(tmp_path / "run") == []
    copied = recover(tmp_path / "run", tmp_path / "copy")
    assert (copied.messages, copied.topics, copied.losses) == (1, 1, ())
    with rosbag2.Reader(tmp_path / "copy") as bag:
        assert bag.connections[0].msgtype == "std_msgs/msg/String"
        assert bag.message_count == 1


def test_a_cut_bag_is_recovered(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bag = write(tmp_path / "run", 5000)
    file = bag / "run_0.mcap"
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    (bag / "metadata.yaml").unlink()
    assert any("no footer" in words for words in errors(bag))
    before = file.read_bytes()
    assert main(["recover", str(bag)]) == 0
    assert "no footer" in capsys.readouterr().err
    assert file.read_bytes() == before
    saved = tmp_path / "run_recovered"
    assert check(saved) == []
    found = [record for _, record in read_bag(saved, [r.Scan])]
    assert len(found) > 1000
    assert found == [scan(number) for number in range(len(found))]


def test_recovering_a_whole_bag_changes_nothing_in_it(tmp_path: Path) -> None:
    bag = write(tmp_path / "run")
    recover(bag, tmp_path / "copy")
    assert list(read_bag(bag)) == list(read_bag(tmp_path / "copy"))
    assert BagReader(tmp_path / "copy").attachments == {"calibration.yaml": "gain: 1\n"}
    mcap = pytest.importorskip("mcap.reader", reason="mcap is not installed")
    with (tmp_path / "copy" / "copy_0.mcap").open("rb") as stream:
        summary = mcap.make_reader(stream).get_summary()
    assert summary.statistics.message_count == 301
    assert summary.chunk_indexes


def test_nothing_to_recover(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"no \.mcap file in this folder"):
        recover(tmp_path, tmp_path / "copy")
    (tmp_path / "x.mcap").write_bytes(b"\x89MCAP0\r\n")
    with pytest.raises(RecordingError, match="no intact message"):
        recover(tmp_path, tmp_path / "copy")
    assert not (tmp_path / "copy").exists()
    bag = write(tmp_path / "run")
    with pytest.raises(RecordingError, match="is not empty: choose another"):
        recover(bag, tmp_path / "run")


def test_a_disk_that_fills_up_is_one_line(tmp_path: Path) -> None:
    """A limit on the size of files stands for the disk's: the system refuses the write alike."""
    bag = write(tmp_path / "run", 5000)

    def limited() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (40_000, 40_000))

    done = subprocess.run(
        [sys.executable, "-m", "flea_diag.tools.main", "recover", str(bag)],
        capture_output=True,
        text=True,
        preexec_fn=limited,
    )
    assert done.returncode == 2
    assert done.stderr == f"flea: cannot write bag {tmp_path}/run_recovered: File too large\n"


def test_what_is_not_there_is_said_to_be_so(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="absent: does not exist"):
        recover(tmp_path / "absent", tmp_path / "copy")
