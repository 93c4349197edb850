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

"""Age of the last reading of each channel, and rows of data quality whose source has stopped."""

from __future__ import annotations

from dataclasses import replace

from flea_diag.wire.records import NEVER_NS, STREAM, ChannelQuality, DataQuality, Quality


def age_s(row: ChannelQuality, quality: DataQuality, silent_s: float) -> float | None:
    """Time since the last reading of a row; None where it has had none, or is no channel.

    Counted by stamps up to the last scan and by the clock of this node since then: the clock of
    the stand may be another one.
    """
    if row.read_ns == NEVER_NS:
        return None
    last_ns = next((r.read_ns for r in quality.channels if r.channel == STREAM), quality.stamp_ns)
    return max(0.0, (last_ns - row.read_ns) / 1e9) + silent_s


def stopped(quality: DataQuality, silent_s: float) -> DataQuality:
    """The same once its source has stopped: whatever had a reading is stale, with its age."""
    return replace(
        quality, channels=tuple(_stopped(r, quality, silent_s) for r in quality.channels)
    )


def _stopped(row: ChannelQuality, quality: DataQuality, silent_s: float) -> ChannelQuality:
    age = age_s(row, quality, silent_s)
    if age is None or row.quality is Quality.ABSENT:
        return row
    before = f"; before that {row.quality.value}: {row.reason}" if row.reason else ""
    words = f"the source has stopped, last reading {age:.1f} s ago{before}"
    return replace(row, quality=Quality.STALE, reason=words)
