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

"""Messages that were not used, as rows of data quality.

Those that no record could be made of are counted by topic and kind, those of a second source by
topic.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from flea_diag.wire.bus import Subscription
from flea_diag.wire.records import ChannelQuality, DataQuality, Quality

ROW = "malformed"
"""Last part of the name of a row; the first is the topic."""


SECOND = "second_source"
"""The same of a stream that two nodes publish."""


def with_malformed(quality: DataQuality, streams: Iterable[Subscription]) -> DataQuality:
    """Data quality, and a row for each topic of which messages were not used, and why."""
    known = tuple(streams)
    rows = (
        *(_row(stream) for stream in known if stream.malformed),
        *(_second(stream) for stream in known if stream.foreign),
    )
    return replace(quality, channels=(*quality.channels, *rows)) if rows else quality


def _row(stream: Subscription) -> ChannelQuality:
    """The readings in use are good: what is malformed is in none of them."""
    counters = tuple(sorted(stream.kinds.items()))
    words = ", ".join(f"{count} by {kind}" for kind, count in counters)
    reason = f"{stream.malformed} messages skipped: {words}"
    name = f"{stream.topic.name.lstrip('/')}/{ROW}"
    return ChannelQuality(name, Quality.GOOD, stream.malformed_ns, reason, counters)


def _second(stream: Subscription) -> ChannelQuality:
    """As good: of the source in use nothing is missing."""
    name = f"{stream.topic.name.lstrip('/')}/{SECOND}"
    counters = (("foreign", stream.foreign),)
    return ChannelQuality(name, Quality.GOOD, 0, stream.words_on_sources, counters)
