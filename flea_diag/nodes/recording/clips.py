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

"""Episode clips: one bag per episode, from before the detection to after the verdict.

Clips are written while the recorder runs. The last seconds of messages are buffered as received.
An episode opens a clip with this buffer; every later message is appended until the clip ends.
Clips of close episodes overlap. Where a clip is missing or incomplete the index gives the reason.
"""

from __future__ import annotations

import json
import time
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from flea_diag.errors import RecordingError, WireError
from flea_diag.formats import stamped
from flea_diag.operator.stream import JUMP_NS
from flea_diag.wire.bags.bag import BagWriter
from flea_diag.wire.messages import codec
from flea_diag.wire.records import NEVER_NS, AmbiguityGroup, Outcome, Scan
from flea_diag.wire.topics import Topic

MOST_RING_BYTES = 256_000_000
LONGEST_NS = 120_000_000_000
"""Time after the detection at which a clip without a verdict ends, with a note in the index."""
LATEST_WORD_NS = 5_000_000_000
"""Largest delay from a detection to the first verdict that names it."""
INDEX = "index.jsonl"


class ClipMessage(NamedTuple):
    """One message as received."""

    topic: Topic
    name: str
    data: bytes
    stamp_ns: int
    received_ns: int


@dataclass
class Clip:
    """Bag of one episode while it is written; ``end_ns`` is NEVER_NS until there is a verdict."""

    detected_ns: int
    start_ns: int
    writer: BagWriter
    group: AmbiguityGroup
    end_ns: int = NEVER_NS
    notes: list[str] = field(default_factory=list)


class Clips:
    """Writes clips from the messages that the recorder receives.

    Parameters
    ----------
    directory
        Folder of the clips, one bag each, with ``index.jsonl``: one line per episode.
    before_s, after_s
        Time before the detection and after the verdict, s.
    """

    def __init__(self, directory: Path, before_s: float, after_s: float) -> None:
        self._directory = directory
        self._before_ns, self._after_ns = round(before_s * 1e9), round(after_s * 1e9)
        self._ring: deque[ClipMessage] = deque()
        self._ring_bytes = 0
        self._latched: dict[str, ClipMessage] = {}
        self._first_ns = self._now_ns = NEVER_NS
        self._open: dict[int, Clip] = {}
        self._begun: deque[int] = deque(maxlen=1000)
        self.count = 0
        self.last = ""

    def take(self, topic: Topic, name: str, data: bytes, stamp_ns: int, received_ns: int) -> None:
        """Buffer a message and append it to the open clips."""
        message = ClipMessage(topic, name, data, stamp_ns, received_ns)
        if topic.record is Scan:
            self._follow(stamp_ns)
        self._keep(message)
        for clip in list(self._open.values()):
            self._write(clip, message)
        if topic.record is AmbiguityGroup:
            self._judge(data)
        if topic.record is Scan:
            self._end_due()

    def close(self, why: str = "truncated: the recording ended") -> None:
        """End the open clips."""
        for clip in list(self._open.values()):
            self._end(clip, why if clip.end_ns == NEVER_NS or self._now_ns < clip.end_ns else "")

    # -- buffer

    def _follow(self, stamp_ns: int) -> None:
        if self._now_ns - stamp_ns > JUMP_NS:
            self.close("truncated: stamps stepped back, a new run began")
            self._ring.clear()
            self._ring_bytes, self._first_ns = 0, NEVER_NS
            self._now_ns = stamp_ns
        if self._first_ns == NEVER_NS:
            self._first_ns = stamp_ns
        self._now_ns = max(self._now_ns, stamp_ns)

    def _keep(self, message: ClipMessage) -> None:
        if message.topic.latched:
            self._latched[message.name] = message
        self._ring.append(message)
        self._ring_bytes += len(message.data)
        oldest_ns = message.received_ns - self._before_ns - LATEST_WORD_NS
        while self._ring and (
            self._ring[0].received_ns < oldest_ns or self._ring_bytes > MOST_RING_BYTES
        ):
            self._ring_bytes -= len(self._ring.popleft().data)

    # -- episodes

    def _judge(self, data: bytes) -> None:
        try:
            group = codec.decode(AmbiguityGroup, data)
        except WireError:
            return  # recorder and clip store unreadable messages as they are
        detected_ns = group.detected_stamp_ns
        if detected_ns == NEVER_NS:
            self._over(group.stamp_ns)
            return
        if detected_ns not in self._begun:
            self._begun.append(detected_ns)
            self._begin(group)
        clip_of = self._open.get(detected_ns)
        if clip_of is not None:
            self._follow_verdict(clip_of, group)

    def _over(self, stamp_ns: int) -> None:
        """Set the end of clips whose episode has closed."""
        for clip in self._open.values():
            if clip.end_ns == NEVER_NS:
                clip.end_ns = stamp_ns + self._after_ns

    def _follow_verdict(self, clip: Clip, group: AmbiguityGroup) -> None:
        same = _said(clip.group) == _said(group)
        clip.group = group
        if group.outcome is Outcome.DETECTED:
            clip.end_ns = NEVER_NS
        elif not same or clip.end_ns == NEVER_NS:
            clip.end_ns = group.stamp_ns + self._after_ns

    def _begin(self, group: AmbiguityGroup) -> None:
        detected_ns = group.detected_stamp_ns
        if group.source != "live":
            self._tell(group, "", ["from a replay: this episode was recorded before"])
            return
        if self._first_ns == NEVER_NS or detected_ns < self._first_ns:
            self._tell(group, "", ["the episode began before this recorder received a scan"])
            return
        start_ns = detected_ns - self._before_ns
        try:
            writer = BagWriter(self._directory / _name(detected_ns), whole_every_s=1.0)
            clip = Clip(detected_ns, start_ns, writer, group)
            self._open[detected_ns] = clip
            for message in self._since(start_ns):
                self._write(clip, message)
        except RecordingError as error:
            self._tell(group, "", [str(error)])
            return
        late_ns = self._first_ns - start_ns
        if late_ns > 0:
            clip.notes.append(f"begins {late_ns / 1e9:.1f} s late: the recorder had just started")

    def _since(self, start_ns: int) -> Iterator[ClipMessage]:
        """Messages from ``start_ns`` on, preceded by the latched topics as of then."""
        window = [message for message in self._ring if message.stamp_ns >= start_ns]
        begin_ns = window[0].received_ns if window else time.time_ns()
        inside = {message.name for message in window if message.topic.latched}
        for name, message in self._latched.items():
            if name not in inside:
                yield message._replace(received_ns=begin_ns)
        yield from window

    def _write(self, clip: Clip, message: ClipMessage) -> None:
        if clip.detected_ns not in self._open:
            return
        try:
            clip.writer.write_raw(message.name, message.data, message.stamp_ns, message.received_ns)
        except RecordingError as error:
            self._end(clip, str(error))

    def _end_due(self) -> None:
        for clip in list(self._open.values()):
            if clip.end_ns != NEVER_NS and self._now_ns > clip.end_ns:
                self._end(clip)
            elif self._now_ns - clip.detected_ns > LONGEST_NS:
                self._end(clip, f"no verdict within {LONGEST_NS / 1e9:.0f} s")

    def _end(self, clip: Clip, why: str = "") -> None:
        del self._open[clip.detected_ns]
        if why:
            clip.notes.append(why)
        try:
            clip.writer.close()
        except RecordingError as error:
            clip.notes.append(str(error))
        self.count += 1
        self._tell(clip.group, clip.writer.directory.name, clip.notes)

    def _tell(self, group: AmbiguityGroup, bag: str, notes: list[str]) -> None:
        """One line in the index: the clip, or the reason why there is none."""
        reason = "; ".join(notes)
        self.last = f"{bag or 'no clip'}{f' ({reason})' if reason else ''}"
        row = {
            "detected_ns": group.detected_stamp_ns,
            "episode": group.episode,
            "outcome": group.outcome.value,
            "members": [member.fault for member in group.members],
            "words": group.words,
            "bag": bag,
            "reason": reason,
        }
        try:
            self._directory.mkdir(parents=True, exist_ok=True)
            with (self._directory / INDEX).open("a", encoding="utf-8") as index:
                index.write(json.dumps(stamped("clip index", row)) + "\n")
        except OSError as error:
            self.last += f"; {INDEX}: {error.strerror}"


def _said(group: AmbiguityGroup) -> tuple[object, ...]:
    return group.outcome, tuple(member.fault for member in group.members)


def _name(detected_ns: int) -> str:
    seconds, rest = divmod(detected_ns, 1_000_000_000)
    moment = time.strftime("%Y%m%dT%H%M%S", time.gmtime(seconds))
    return f"episode_{moment}_{rest // 1_000_000:03d}Z"
