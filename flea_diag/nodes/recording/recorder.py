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

"""``ros2 run flea_diag recorder``: topics of a stand to an MCAP bag, finalised twice a second."""

from __future__ import annotations

import itertools
import platform
import shutil
import sys
import time
from dataclasses import dataclass
from importlib.metadata import distributions
from pathlib import Path
from typing import Any

from flea_diag.configuration.stand_parameters import StandParameters, stand_of
from flea_diag.errors import ConfigurationError, RecordingError, line_of
from flea_diag.nodes.health import HealthReport
from flea_diag.nodes.recording.clips import Clips
from flea_diag.wire.bags.bag import BagSplit, BagWriter
from flea_diag.wire.bus import Bus, Program
from flea_diag.wire.command_budget import MEGABYTE
from flea_diag.wire.messages.cdr import CdrReader
from flea_diag.wire.parameters import parameter
from flea_diag.wire.records import Health
from flea_diag.wire.topics import TOPIC_NAMED, TOPICS, Topic

ALL = "all"
WHOLE_EVERY_S = 0.5
"""Period at which the bag is finalised: a crash loses less than 1 s, also on a slow machine."""
WAITING = 1000
"""Queue length per topic: 10 s of scans, for a disk that stalls."""
PACKAGES = ("flea-diag", "numpy", "scipy", "numba", "mcap", "rosbags", "ros-rclpy", "rclpy")
"""Packages whose versions are stored in a bag."""


@dataclass(frozen=True)
class RecorderParameters(StandParameters):
    """Parameters of the recorder; the files of the stand are stored in the bag."""

    directory: str = parameter(
        "",
        "bag to write, must not exist; empty: bags/runs/<UTC time> below the working directory",
        read_only=True,
    )
    topics: tuple[str, ...] = parameter(
        (ALL,),
        "topics to record, without namespace, or all",
        read_only=True,
    )
    split_mb: int = parameter(
        0, "file size at which a new file is started; 0: never", unit="MB", minimum=0
    )
    split_s: float = parameter(
        3600.0, "duration after which a new file is started; 0: never", unit="s", minimum=0.0
    )
    clip_before_s: float = parameter(
        10.0,
        "start of an episode clip before the detection",
        unit="s",
        minimum=0.0,
        maximum=120.0,
        read_only=True,
    )
    clip_after_s: float = parameter(
        5.0,
        "end of an episode clip after the verdict",
        unit="s",
        minimum=0.0,
        maximum=120.0,
        read_only=True,
    )
    clips: bool = parameter(True, "write a clip of each episode to DIRECTORY-clips", read_only=True)
    warn_free_mb: int = parameter(
        2000, "free disk space below which the node warns", unit="MB", minimum=0
    )
    stop_free_mb: int = parameter(
        500, "free disk space below which recording ends", unit="MB", minimum=0
    )


class Recorder:
    """Writes the bytes of each message as received, with time of receipt and own stamp."""

    def __init__(self, bus: Bus[Any], parameters: RecorderParameters) -> None:
        self._bus = bus
        self._parameters = parameters
        self._directory = checked_directory(parameters.directory)
        topics = chosen_topics(parameters.topics)
        free_mb = self._free_mb()
        if free_mb < parameters.stop_free_mb:
            raise ConfigurationError(self._full(free_mb))
        kept = {**stand_of(parameters).texts(), "versions.txt": versions()}
        split = BagSplit(parameters.split_mb * MEGABYTE, parameters.split_s)
        self._writer = BagWriter(self._directory, whole_every_s=None, split=split)
        for name, text in kept.items():
            self._writer.attach(name, text)
        self._health = HealthReport(bus)
        self._messages = 0
        self._is_second = itertools.cycle((False, True))
        self._clips = Clips(
            self._directory.with_name(self._directory.name + "-clips"),
            parameters.clip_before_s,
            parameters.clip_after_s,
        )
        self._said = 0
        """How many losses of the bag have been said."""
        bus.advertise(Health)
        for topic in topics:
            self._record(topic)
        bus.on_parameters(self._reconfigure)
        bus.every(WHOLE_EVERY_S, self._make_whole)
        bus.on("deactivate", self._pause)
        bus.info(f"recording {len(topics)} topics to {self._directory}")

    def close(self) -> None:
        """Finish the bag and print its path."""
        self._clips.close()
        self._writer.close()
        text = f"{self._messages} messages in {self._directory}" if self._messages else "no message"
        print(f"recorder: {line_of(text)}", file=sys.stderr, flush=True)

    def _reconfigure(self, parameters: RecorderParameters) -> None:
        self._parameters = parameters

    def _record(self, topic: Topic) -> None:
        name = self._bus.full_name(topic.record)

        def write(data: bytes) -> None:
            received_ns = time.time_ns()
            stamp_ns = CdrReader(data).stamp_ns()
            if stamp_ns < 0:
                # It is kept as it came; no file can say that it was sent before 1970.
                self._bus.warn(f"{name}: stamp {stamp_ns} ns is before 1970: the source's clock")
                stamp_ns = received_ns
            # A latched record may be of any age: how old it is says nothing of this node's lag.
            if not topic.latched:
                self._health.arrived(topic.record, stamp_ns, late=False)
            self._health.taken()
            try:
                self._writer.write_raw(name, data, stamp_ns, received_ns)
            except RecordingError as error:
                self._bus.end(error)
            if self._parameters.clips:
                self._clips.take(topic, name, data, stamp_ns, received_ns)
            self._messages += 1

        self._bus.subscribe_raw(topic.record, write, WAITING)

    def _make_whole(self) -> None:
        try:
            self._writer.make_whole()
        except RecordingError as error:
            self._bus.end(error)
        for words in self._writer.losses[self._said :]:
            self._bus.caution(f"{words}; recording goes on in {self._writer.path.name}")
        self._said = len(self._writer.losses)
        if next(self._is_second):
            self._watch_disk()

    def _pause(self) -> None:
        self._make_whole()
        self._bus.caution("deactivated: nothing is recorded until the node is activated again")

    def _watch_disk(self) -> None:
        free_mb = self._free_mb()
        self._bus.publish(
            self._health.record(
                (
                    ("messages", str(self._messages)),
                    ("free_mb", f"{free_mb:.0f}"),
                    ("clips", str(self._clips.count)),
                    ("last_clip", self._clips.last),
                )
            )
        )
        if free_mb < self._parameters.stop_free_mb:
            self._bus.end(RecordingError(f"recording ended: {self._full(free_mb)}"))
        elif free_mb < self._parameters.warn_free_mb:
            self._bus.warn(
                f"{free_mb:.0f} MB left for {self._directory}, recording ends at "
                f"{self._parameters.stop_free_mb} MB (stop_free_mb): free disk space"
            )

    def _free_mb(self) -> float:
        return shutil.disk_usage(_existing(self._directory)).free / MEGABYTE

    def _full(self, free_mb: float) -> str:
        return (
            f"{free_mb:.0f} MB left on the disk of {self._directory}, below the limit stop_free_mb "
            f"= {self._parameters.stop_free_mb} MB: free disk space or choose another directory"
        )


def versions() -> str:
    """Software versions of a recording, one per line."""
    packages = sorted(
        f"{each.name} {each.version}"
        for each in distributions()
        if (each.name or "").replace("_", "-").lower() in PACKAGES
    )
    return "\n".join([f"Python {platform.python_version()}", platform.platform(), *packages, ""])


def checked_directory(directory: str) -> Path:
    """Folder of the bag to write.

    Raises
    ------
    ConfigurationError
        The folder exists: a recording is never overwritten.
    """
    path = Path(directory or f"bags/runs/{time.strftime('%Y%m%dT%H%M%SZ', time.gmtime())}")
    if path.exists():
        raise ConfigurationError(f"directory = {directory!r} exists: name a new bag")
    return path


def chosen_topics(names: tuple[str, ...]) -> tuple[Topic, ...]:
    """Rows of the topic table for these names.

    Raises
    ------
    ConfigurationError
        A name is not in the table.
    """
    if names == (ALL,):
        return TOPICS
    for name in names:
        if name.lstrip("/") not in TOPIC_NAMED:
            known = ", ".join(sorted(TOPIC_NAMED))
            raise ConfigurationError(f"topics: {name!r} is unknown: choose all, or some of {known}")
    return tuple(TOPIC_NAMED[name.lstrip("/")] for name in dict.fromkeys(names))


def check(parameters: RecorderParameters) -> None:
    """Refuse parameters and files with which nothing could be recorded."""
    checked_directory(parameters.directory)
    chosen_topics(parameters.topics)
    stand_of(parameters).texts()


def _existing(path: Path) -> Path:
    """The path, or its nearest existing parent."""
    return next(place for place in (path, *path.absolute().parents) if place.exists())


def program() -> Program:
    """Description of this node."""
    return Program(
        "recorder",
        "Records the topics of a stand and its diagnosis to an MCAP bag, finalised twice a second.",
        RecorderParameters,
        lambda bus, parameters: Recorder(bus, parameters).close,
        subscribes=tuple(topic.record for topic in TOPICS),
        publishes=(Health,),
        examples=(
            "ros2 run flea_diag recorder --ros-args -p directory:=bags/runs/jam_1",
            "ros2 run flea_diag recorder --ros-args -p topics:='[sensors/slow, ambiguity_group]'",
        ),
        check=check,
    )
