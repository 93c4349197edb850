"""Messages that no record could be made of, as rows of data quality: counted by topic and kind."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from flea_diag.wire.bus import Subscription
from flea_diag.wire.records import ChannelQuality, DataQuality, Quality

ROW = "malformed"
"""Last part of the name of a row; the first is the topic."""


def with_malformed(quality: DataQuality, streams: Iterable[Subscription]) -> DataQuality:
    """Data quality, and a row for each topic of which messages were malformed."""
    rows = tuple(_row(stream) for stream in streams if stream.malformed)
    return replace(quality, channels=(*quality.channels, *rows)) if rows else quality


def _row(stream: Subscription) -> ChannelQuality:
    """The readings in use are good: what is malformed is in none of them."""
    counters = tuple(sorted(stream.kinds.items()))
    words = ", ".join(f"{count} by {kind}" for kind, count in counters)
    reason = f"{stream.malformed} messages skipped: {words}"
    name = f"{stream.topic.name.lstrip('/')}/{ROW}"
    return ChannelQuality(name, Quality.GOOD, stream.malformed_ns, reason, counters)
