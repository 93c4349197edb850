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

"""Status of the stand and of the nodes: streams, channels, health."""

from __future__ import annotations

import math
from dataclasses import replace

from flea_diag.operator.panel import Line, Panel, clock
from flea_diag.operator.state import OperatorState
from flea_diag.operator.stream import StreamState
from flea_diag.operator.words import tr
from flea_diag.wire.records import TOLD, ChannelQuality, Health, Level, Quality, Scan
from flea_diag.wire.wording import QUALITY_LEVEL

COMPONENT = ": "
"""Marks the names of statuses that repeat the stand's state, which has panels of its own."""
OLD_S = 3600.0
COMPILING = "compiling, "
"""Begins the message of a node that is not ready since it compiles."""
STREAM_LEVEL = {"running": None, "waiting": None, "stale": Level.STALE}


def streams(state: OperatorState, now_ns: int) -> Panel:
    """Rate and errors of each continuous topic."""
    rows = tuple(
        _stream(replace(stream, lost=stream_losses(state, stream)), now_ns)
        for stream in state.streams.values()
    )
    return Panel("streams", tr("STREAMS"), rows)


def _stream(stream: StreamState, now_ns: int) -> Line:
    standing = stream.standing(now_ns)
    level = STREAM_LEVEL[standing]
    if standing == "waiting":
        return Line(f"{stream.name:16} {tr('waiting for the first record')}")
    shown = tr("rate ?") if math.isnan(stream.rate_hz) else f"{stream.rate_hz:.1f} Hz"
    if standing == "stale":
        shown = tr("STALE for {seconds:.0f} s", seconds=stream.silent_s(now_ns))
    counts = [(tr("missing"), stream.missing), (tr("late"), stream.late), (tr("lost"), stream.lost)]
    told = ", ".join(f"{count} {name}" for name, count in counts)
    received = tr("{count} received", count=stream.received)
    worse = level or (Level.WARN if any(count for _, count in counts) else None)
    return Line(f"{stream.name:16} {shown:9} {received}, {told}", worse)


def quality_rows(state: OperatorState, now_ns: int) -> tuple[ChannelQuality, ...]:
    """Quality of each channel and stream as of now: stale where no scans arrive any more.

    The diagnosis tells changes alone; whoever has died tells none.
    """
    if state.quality is None:
        return ()
    rows, scans = state.quality.channels, state.stream(Scan)
    if scans.standing(now_ns) != "stale":
        return rows
    silent_s = scans.silent_s(now_ns)
    why = tr("no scan arrives")
    if silent_s < OLD_S:
        why = tr("no scan for {seconds:.0f} s", seconds=silent_s)
    return tuple(
        replace(row, quality=Quality.STALE, since_ns=scans.stamp_ns, reason=_joined(why, row))
        if row.quality in (Quality.GOOD, Quality.STALE)
        else replace(row, reason=_joined(why, row))
        for row in rows
    )


def _joined(why: str, row: ChannelQuality) -> str:
    return tr("{why}; before: {reason}", why=why, reason=row.reason) if row.reason else why


def stream_losses(state: OperatorState, stream: StreamState) -> int:
    """Records that the diagnosis lacks, as it counts them, or this screen where it does not."""
    rows = state.quality.channels if state.quality is not None else ()
    told = (dict(row.counters).get("lost", 0) for row in rows if row.channel == stream.name)
    return max((stream.lost, *told))


def channels(state: OperatorState, now_ns: int = 0) -> Panel | None:
    """Channels that are not good, with the time and the reason."""
    if state.quality is None:
        return None
    rows = quality_rows(state, now_ns)
    bad = [row for row in rows if row.quality != Quality.GOOD]
    told = [row for row in rows if row.channel in TOLD and row.quality == Quality.GOOD]
    good = len(rows) - len(bad) - len(told)
    lines = tuple(
        Line(
            f"{row.channel:28} {tr(row.quality.value)} {tr('since')} {clock(row.since_ns)}: "
            f"{row.reason}",
            QUALITY_LEVEL[row.quality] or None,
        )
        for row in bad
    )
    lines += tuple(
        Line(f"{row.channel:28} {row.reason} {tr('since')} {clock(row.since_ns)}")
        for row in told
        if row.reason
    )
    counts = tr("{good} good, {bad} not", good=good, bad=len(bad))
    return Panel("channels", f"{tr('CHANNELS')}  {counts}", lines)


def compiling(state: OperatorState) -> str:
    """What is being compiled at the first start, and how long it will take; empty if nothing."""
    told = (
        tr("{node} is {doing}", node=name.rpartition("/")[2], doing=health.message)
        for name, health in sorted(state.health.items())
        if health.message.startswith(COMPILING)
    )
    return "; ".join(told)


def nodes(state: OperatorState) -> Panel | None:
    """Health of the nodes."""
    if not state.health:
        return None
    own = sorted(name for name in state.health if COMPONENT not in name)
    lines = tuple(_node(name, state.health[name]) for name in own)
    return Panel("nodes", tr("NODES"), lines)


def _node(node: str, health: Health) -> Line:
    shown = [f"{key} {value}" for key, value in health.values if _worth_showing(key, value)]
    text = f"{node:20} {health.level.name:5} {health.message}  {', '.join(shown)}".rstrip()
    return Line(text, health.level or None)


def _worth_showing(key: str, value: str) -> bool:
    counter = key.rpartition("/")[2]
    return "/" not in key or (counter != "received" and value != "0")
