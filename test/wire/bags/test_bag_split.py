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

"""A bag that goes on in another file: nothing lost between them, and other readers open it."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from flea_diag.tools.main import main
from flea_diag.wire.bags.bag import BagReader, BagSplit, BagWriter, read_bag
from flea_diag.wire.records import Record, Scan

EPOCH_NS = 1_283_500_000 * 10**9
PERIOD_NS = 10_000_000
COUNT = 1000


def scans() -> list[Scan]:
    return [Scan(EPOCH_NS + k * PERIOD_NS, ("motor_current",), (float(k),)) for k in range(COUNT)]


def written(folder: Path, split: BagSplit) -> Path:
    with BagWriter(folder / "run", whole_every_s=None, split=split) as bag:
        bag.attach("calibration.yaml", "gain: 1\n")
        for record in scans():
            bag.write(record)
        assert bag.counts == {"/sensors/slow": COUNT}
    return folder / "run"


def records(bag: Path) -> list[Record]:
    losses: list[str] = []
    found = [record for _, record in read_bag(bag, losses=losses)]
    assert losses == []
    return found


@pytest.mark.parametrize(
    ("split", "files"),
    [(BagSplit(), 1), (BagSplit(duration_s=3.0), 4), (BagSplit(size_bytes=20_000), None)],
)
def test_all_files_together_are_the_recording(
    tmp_path: Path, split: BagSplit, files: int | None
) -> None:
    bag = written(tmp_path, split)
    parts = sorted(bag.glob("*.mcap"))
    assert len(parts) == files or (files is None and len(parts) > 2)
    assert records(bag) == scans()
    assert main(["bag", "check", str(bag)]) == 0


def test_the_files_follow_one_another_in_time(tmp_path: Path) -> None:
    bag = written(tmp_path, BagSplit(duration_s=3.0))
    for k, part in enumerate(sorted(bag.glob("*.mcap"))):
        assert part.name == f"run_{k}.mcap"
        stamps = [record.stamp_ns for _, record in read_bag(part)]
        assert stamps[0] == EPOCH_NS + k * 300 * PERIOD_NS
        assert BagReader(part).attachments == {"calibration.yaml": "gain: 1\n"}


def test_rosbags_reads_it_as_one(tmp_path: Path) -> None:
    rosbag2 = pytest.importorskip("rosbags.rosbag2", reason="rosbags is not installed")
    bag = written(tmp_path, BagSplit(duration_s=3.0))
    with rosbag2.Reader(bag) as reader:
        assert reader.message_count == COUNT
        assert reader.duration == (COUNT - 1) * PERIOD_NS + 1
        assert [log_ns for _, log_ns, _ in reader.messages()] == [s.stamp_ns for s in scans()]


def test_metadata_tell_each_file_s_share(tmp_path: Path) -> None:
    bag = written(tmp_path, BagSplit(duration_s=3.0))
    told = yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert told["relative_file_paths"] == [f"run_{k}.mcap" for k in range(4)]
    assert [part["message_count"] for part in told["files"]] == [300, 300, 300, 100]
    assert told["message_count"] == COUNT
    assert told["topics_with_message_count"][0]["message_count"] == COUNT


def test_what_is_whole_stays_whole_across_a_split(tmp_path: Path) -> None:
    """As after kill -9: no close, the last file as make_whole left it."""
    bag = BagWriter(tmp_path / "run", whole_every_s=None, split=BagSplit(duration_s=3.0))
    for record in scans()[:650]:
        bag.write(record)
    bag.make_whole()
    assert records(tmp_path / "run") == scans()[:650]
    bag.close()
