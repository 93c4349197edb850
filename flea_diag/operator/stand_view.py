"""Status of the stand and of the nodes: streams, channels, health."""

from __future__ import annotations

import math

from flea_diag.operator.panel import Line, Panel, clock
from flea_diag.operator.state import OperatorState
from flea_diag.operator.stream import StreamState
from flea_diag.wire.records import Health, Level, Quality
from flea_diag.wire.wording import QUALITY_LEVEL

COMPONENT = ": "
"""Marks the names of statuses that repeat the stand's state, which has panels of its own."""
STREAM_LEVEL = {"running": None, "waiting": None, "stale": Level.STALE}


def streams(state: OperatorState, now_ns: int) -> Panel:
    """Rate and errors of each continuous topic."""
    rows = tuple(_stream(stream, now_ns) for stream in state.streams.values())
    return Panel("streams", "STREAMS", rows)


def _stream(stream: StreamState, now_ns: int) -> Line:
    standing = stream.standing(now_ns)
    level = STREAM_LEVEL[standing]
    if standing == "waiting":
        return Line(f"{stream.name:16} waiting for the first record")
    rate = "rate ?" if math.isnan(stream.rate_hz) else f"{stream.rate_hz:.1f} Hz"
    shown = f"STALE for {stream.silent_s(now_ns):.0f} s" if standing == "stale" else rate
    counts = [("missing", stream.missing), ("late", stream.late), ("lost", stream.lost)]
    told = ", ".join(f"{count} {name}" for name, count in counts)
    worse = level or (Level.WARN if any(count for _, count in counts) else None)
    return Line(f"{stream.name:16} {shown:9} {stream.received} received, {told}", worse)


def channels(state: OperatorState) -> Panel | None:
    """Channels that are not good, with the time and the reason."""
    if state.quality is None:
        return None
    bad = [row for row in state.quality.channels if row.quality != Quality.GOOD]
    good = len(state.quality.channels) - len(bad)
    lines = tuple(
        Line(
            f"{row.channel:28} {row.quality.value} since {clock(row.since_ns)}: {row.reason}",
            QUALITY_LEVEL[row.quality] or None,
        )
        for row in bad
    )
    return Panel("channels", f"CHANNELS  {good} good, {len(bad)} not", lines)


def nodes(state: OperatorState) -> Panel | None:
    """Health of the nodes."""
    if not state.health:
        return None
    own = sorted(name for name in state.health if COMPONENT not in name)
    lines = tuple(_node(name, state.health[name]) for name in own)
    return Panel("nodes", "NODES", lines)


def _node(node: str, health: Health) -> Line:
    shown = [f"{key} {value}" for key, value in health.values if _worth_showing(key, value)]
    text = f"{node:20} {health.level.name:5} {health.message}  {', '.join(shown)}".rstrip()
    return Line(text, health.level or None)


def _worth_showing(key: str, value: str) -> bool:
    counter = key.rpartition("/")[2]
    return "/" not in key or (counter != "received" and value != "0")
