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

"""Clips of episodes: from before the detection to after the verdict, or a reason."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

from support.verdicts import FIRST, LAST, NOMINAL, START

from flea_diag.nodes.recording.clips import INDEX, Clips
from flea_diag.tools.main import main as flea
from flea_diag.wire.bags.bag import read_bag
from flea_diag.wire.messages import codec
from flea_diag.wire.records import (
    AmbiguityGroup,
    ChannelInfo,
    ChannelTable,
    Record,
    Scan,
)
from flea_diag.wire.topics import TOPIC_OF

SECOND = 10**9
TABLE = ChannelTable(
    START - 100 * SECOND, "stand", (ChannelInfo("motor_current", "A", -10, 10, 100.0),)
)


def scan(stamp_ns: int) -> Scan:
    return Scan(stamp_ns, ("motor_current",), (1.0,))


def send(clips: Clips, record: Record, received_ns: int | None = None) -> None:
    topic = TOPIC_OF[type(record)]
    name = f"/{topic.name}"
    received = record.stamp_ns if received_ns is None else received_ns
    clips.take(topic, name, codec.encode(record, "stand"), record.stamp_ns, received)


def run(clips: Clips, from_s: float, to_s: float, verdicts: dict[float, AmbiguityGroup]) -> None:
    """Scans at 10 Hz, and verdicts at their seconds after START."""
    for tenth in range(round(from_s * 10), round(to_s * 10)):
        stamp = START + tenth * SECOND // 10
        send(clips, scan(stamp))
        if tenth / 10 in verdicts:
            send(clips, replace(verdicts[tenth / 10], stamp_ns=stamp))


def index(folder: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (folder / INDEX).read_text("utf-8").splitlines()]


def scans(bag: Path) -> list[float]:
    return [(r.stamp_ns - START) / SECOND for _, r in read_bag(bag, (Scan,))]


def test_a_clip_reaches_from_before_the_detection_to_after_the_verdict(tmp_path: Path) -> None:
    clips = Clips(tmp_path, before_s=3.0, after_s=2.0)
    send(clips, TABLE, START - 50 * SECOND)
    run(clips, -20.0, 12.0, {0.2: FIRST, 4.0: LAST, 5.0: replace(LAST, seq=9)})
    (row,) = index(tmp_path)
    assert row["bag"] == "episode_20231114T221320_000Z"
    assert (row["outcome"], row["members"], row["reason"]) == ("ISOLATED", ["jam"], "")
    seen = scans(tmp_path / row["bag"])
    assert seen[0] == -3.0
    assert 5.9 < seen[-1] <= 6.2
    assert len(seen) == round((seen[-1] - seen[0]) * 10) + 1, "nothing is missing in between"


def test_a_clip_has_the_channel_table_and_opens_like_any_bag(tmp_path: Path) -> None:
    clips = Clips(tmp_path, 3.0, 2.0)
    send(clips, TABLE, START - 50 * SECOND)
    run(clips, -20.0, 12.0, {0.2: FIRST, 4.0: LAST})
    bag = tmp_path / index(tmp_path)[0]["bag"]
    assert [r for _, r in read_bag(bag, (ChannelTable,))] == [TABLE]
    assert flea(["bag", "check", str(bag)]) == 0


def test_two_that_follow_closely_have_a_clip_each_and_share_what_lies_between(
    tmp_path: Path,
) -> None:
    clips = Clips(tmp_path, 3.0, 2.0)
    second = START + 2 * SECOND
    again = {"detected_stamp_ns": second, "episode": 2}
    run(
        clips,
        -20.0,
        12.0,
        {0.2: FIRST, 1.0: LAST, 1.8: NOMINAL, 2.1: replace(FIRST, **again),
         4.0: replace(LAST, **again)},
    )  # fmt: skip
    one, two = sorted(index(tmp_path), key=lambda row: row["detected_ns"])
    assert (one["reason"], two["reason"]) == ("", "")
    first, later = scans(tmp_path / one["bag"]), scans(tmp_path / two["bag"])
    assert (first[0], later[0]) == (-3.0, -1.0)
    assert first[-1] >= 3.0
    assert later[-1] >= 6.0
    assert set(later) & set(first)


def test_a_recorder_that_started_later_gives_the_reason(tmp_path: Path) -> None:
    clips = Clips(tmp_path, 3.0, 2.0)
    run(clips, 1.0, 8.0, {2.0: LAST})
    (row,) = index(tmp_path)
    assert row["bag"] == ""
    assert "began before this recorder received a scan" in row["reason"]
    assert "no clip" in clips.last


def test_a_clip_that_begins_later_says_by_how_much(tmp_path: Path) -> None:
    clips = Clips(tmp_path, 3.0, 2.0)
    run(clips, -1.0, 8.0, {2.0: LAST})
    (row,) = index(tmp_path)
    assert row["reason"] == "begins 2.0 s late: the recorder had just started"
    assert scans(tmp_path / row["bag"])[0] == -1.0


def test_a_replay_is_not_cut_again(tmp_path: Path) -> None:
    clips = Clips(tmp_path, 3.0, 2.0)
    run(clips, -5.0, 8.0, {2.0: replace(LAST, source="replay")})
    assert "a replay" in index(tmp_path)[0]["reason"]


def test_an_end_of_recording_ends_the_clip_and_says_so(tmp_path: Path) -> None:
    clips = Clips(tmp_path, 3.0, 2.0)
    run(clips, -5.0, 3.0, {0.2: FIRST})
    clips.close()
    (row,) = index(tmp_path)
    assert row["reason"] == "truncated: the recording ended"
    assert scans(tmp_path / row["bag"])[0] == -3.0


def test_a_folder_that_cannot_be_written_is_a_reason_and_no_crash(tmp_path: Path) -> None:
    (tmp_path / "clips").write_text("a file where the folder should be", encoding="utf-8")
    clips = Clips(tmp_path / "clips", 3.0, 2.0)
    run(clips, -5.0, 3.0, {0.2: FIRST})
    assert clips.last.startswith("no clip")


def test_a_verdict_that_never_comes_ends_the_clip_in_the_end(tmp_path: Path) -> None:
    clips = Clips(tmp_path, 3.0, 2.0)
    run(clips, -5.0, 130.0, {0.2: FIRST})
    assert index(tmp_path)[0]["reason"] == "no verdict within 120 s"
