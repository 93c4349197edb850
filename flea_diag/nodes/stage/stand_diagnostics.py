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

"""Status of the stand on /diagnostics, for rqt_robot_monitor and diagnostic_aggregator.

Repeats the verdict and the state of the channels, which have topics of their own, once a second
and on every change. No node of ours reads it. Names are ``NODE: verdict`` and ``NODE: channels``
(REP-107), beside ``NODE`` for the health of the node itself. While the source is silent nothing is
repeated: whoever watches calls it stale by a time limit of his own, as for any other status.
"""

from __future__ import annotations

from collections import Counter

from flea_diag.nodes.stage.channel_age import age_s
from flea_diag.operator.judgement_view import JudgedRow, judged_rows
from flea_diag.wire.messages.summary import summary
from flea_diag.wire.records import (
    AmbiguityGroup,
    ChannelQuality,
    ChannelTable,
    DataQuality,
    Health,
    Level,
    Outcome,
    Quality,
    Record,
)
from flea_diag.wire.wording import sentence_of, words_of

MIRRORED: tuple[type, ...] = (AmbiguityGroup, DataQuality)
REPLAY = "replay: "
"""Begins the words of a verdict that says nothing of the stand as it is now."""


def mirrored(
    record: AmbiguityGroup | DataQuality,
    node: str,
    now_ns: int,
    serial: str = "",
    live: bool = True,
) -> Health:
    """Diagnostic status with the content of a record of one of the ``MIRRORED`` types.

    Parameters
    ----------
    serial
        Of the actuator, where its channel table states one.
    live
        Whether it says how the stand is now; a replay is OK whatever it finds.
    """
    if isinstance(record, DataQuality):
        kind, brief, values = "channels", record, _of_channels(record)
    else:
        kind, brief = "verdict", summary(record)
        values = (*_of_group(brief), *_faults(record))
        live = live and record.source == "live"
    words = words_of(brief)
    level = words.level if live and not _at_rest(record) else Level.OK
    message = ("" if live else REPLAY) + sentence_of(words)
    return Health(now_ns, f"{node}: {kind}", level, message, values, serial)


def serial_of(table: ChannelTable) -> str:
    """Serial of the actuator: that of most of its channels, the first of those as frequent."""
    counts = Counter(row.serial for row in table.channels if row.serial)
    return max(counts, key=lambda serial: counts[serial], default="")


def _at_rest(record: Record) -> bool:
    """Whether nothing is wrong but that nothing moves, as with a parked robot."""
    return isinstance(record, AmbiguityGroup) and record.outcome is Outcome.NOT_OBSERVABLE


def _of_group(group: AmbiguityGroup) -> tuple[tuple[str, str], ...]:
    members = tuple(
        (f"possible/{c.fault}", f"probability {c.probability:.3g}: {c.reason}")
        for c in group.members
        if c.reason
    )
    return (
        ("outcome", group.outcome.value),
        ("episode", str(group.episode)),
        ("source", group.source),
        ("members", ", ".join(c.fault for c in group.members)),
        *members,
    )


def _faults(group: AmbiguityGroup) -> tuple[tuple[str, str], ...]:
    """Which faults were looked for, and why the others were not."""
    reasons = tuple((f"not_observable/{fault}", why) for fault, why in group.not_observable)
    return (("looked_for", ", ".join(group.looked_for)), *reasons)


def _of_channels(quality: DataQuality) -> tuple[tuple[str, str], ...]:
    channels = tuple((row.channel, _of_channel(row, quality)) for row in quality.channels)
    return channels + tuple((f"judged/{row.test}", _share(row)) for row in judged_rows(quality))


def _of_channel(row: ChannelQuality, quality: DataQuality) -> str:
    said = f"{row.quality.value}: {row.reason}" if row.reason else row.quality.value
    age = None if row.quality is Quality.STALE else age_s(row, quality, 0.0)
    return said if age is None else f"{said}, last reading {age:.1f} s ago"


def _share(row: JudgedRow) -> str:
    why = f": {row.why}" if row.why else ""
    said = f"{row.recent_text} of the last 10 s, {row.run_text} of the run{why}"
    return said if row.judged else f"not judged, {said}"
