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

"""One message of each topic as ``ros2 topic echo`` prints it, for docs/messages.md.

    python docs/hooks/messages.py        renew the examples, after the bags were made anew

The bytes are those of the bags below ``bags``, read by rosbags. Topics that none of them holds
are shown from a record, through the codec. ``test/project/test_messages.py`` holds the page
against this.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import yaml
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from flea_diag.wire import records as r
from flea_diag.wire.messages.codec import decode, encode
from flea_diag.wire.messages.summary import summary
from flea_diag.wire.messages.verdict_numbers import verdict_numbers
from flea_diag.wire.topics import TOPIC_OF

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "messages.md"
LIVE = ROOT / "bags" / "live_motor_current_bias"
JAM = ROOT / "bags" / "jam"

WHERE: dict[str, Path] = {
    "sensors/slow": LIVE,
    "sensors/channels": LIVE,
    "sensors/vibration": JAM,
    "truth": LIVE,
    "residual": LIVE,
    "data_quality": LIVE,
    "fault_detected": LIVE,
    "symbol": LIVE,
    "hypotheses": LIVE,
    "ambiguity_group": LIVE,
    "/diagnostics": LIVE,
}
"""Topic -> bag whose last message of it, if it is not STALE, is shown."""

AS_NOW: dict[str, tuple[type, Callable[[Any], r.Record]]] = {
    "data_quality": (r.DataQuality, lambda quality: quality),
    "hypotheses": (r.AmbiguityGroup, r.AmbiguityGroup.hypotheses),
    "ambiguity_group": (r.AmbiguityGroup, summary),
}
"""Topic whose format is newer than the bag -> record in the bag, and what is published now."""

_T = 1_700_000_008_500_000_000
MADE: tuple[r.Record, ...] = (
    r.VibrationLevel(
        _T,
        ("accelerometer_1_x", "accelerometer_2_x"),
        (1.0625, 2.5),
        (3.125, 6.75),
    ),
    r.FeatureRequest(_T, 1, 1, "accelerometer_2_crest", _T - 1_000_000_000, _T),
    r.FeatureValue(
        _T + 150_000_000, 1, 1, "accelerometer_2_crest", _T - 1_000_000_000, _T,
        4.25, "1", "0^", 3.5, 4.5, "", 0.5,
    ),
    verdict_numbers(
        r.AmbiguityGroup(
            _T, r.Outcome.ISOLATED, 1, 3, 9,
            (r.Candidate("jam", "jam+", 0.97, "fits", (), 118.5, 4.25, "N"),),
            (), _T - 2_500_000_000, "the fault is jam", "", "live",
        )
    ),
    r.SizeTrend(
        _T, 1, "winding_short", "resistance lost", "ohm",
        tuple(
            r.SizeAt(_T - (4 - k) * 20_000_000_000, 0.25 + 0.0625 * k, 0.015625) for k in range(4)
        ),
        0.4375, 0.03125, "grows", 0.003125, 0.000244140625, 0.875,
        _T + 105_000_000_000, _T + 140_000_000_000, _T + 190_000_000_000, 0.0, 0.0,
    ),
    r.Remark(_T, r.RemarkKind.COMMENT, "console", "lubricated at noon", "live", _T - 5_000_000_000),
)  # fmt: skip
"""Topics that no bag holds."""

FEW = 8
"""Elements of a sequence that the page shows."""
STATUSES, PAIRS = 2, 24
"""The same of the statuses of a judgement, and of the key/values of one."""
CUT = 128
"""Characters of a string that ``ros2 topic echo`` shows."""

_STORE = get_typestore(Stores.ROS2_JAZZY)
_BLOCK = re.compile(r"(<!-- echo (?P<topic>\S+) -->\n```yaml\n).*?(```\n)", re.DOTALL)


def examples(text: str) -> str:
    """The page with each example made anew."""
    return _BLOCK.sub(lambda found: found[1] + echo(found["topic"]) + found[3], text)


def echo(topic: str) -> str:
    """One message of a topic, in YAML."""
    shown = plain(_message(topic))
    return yaml.dump(shown, sort_keys=False, allow_unicode=True, width=10**6) + "---\n"


def _message(topic: str) -> Any:
    for record in MADE:
        row = TOPIC_OF[type(record)]
        if row.name == topic:
            return _STORE.deserialize_cdr(encode(record), row.message)
    kind, now = AS_NOW.get(topic, (None, None))
    recorded = (TOPIC_OF[kind].name if kind else topic).lstrip("/")
    with AnyReader([WHERE[topic]], default_typestore=_STORE) as reader:
        connections = [c for c in reader.connections if c.topic.lstrip("/") == recorded]
        found = [
            (bytes(raw), reader.deserialize(raw, c.msgtype))
            for c, _, raw in reader.messages(connections)
        ]
    raw, message = next(row for row in reversed(found) if not _is_stale(row[1]))
    if kind is None or now is None:
        return message
    record = now(decode(kind, raw))
    return _STORE.deserialize_cdr(encode(record), TOPIC_OF[type(record)].message)


def _is_stale(message: Any) -> bool:
    """Whether it only says that the source has stopped, as all judgements do in the end."""
    return bool(getattr(message, "status", ())) and message.status[0].level == r.Level.STALE


def plain(value: Any) -> Any:
    """A message as mappings and lists, cut as ``ros2 topic echo`` does and to ``FEW``."""
    if hasattr(value, "__msgtype__"):
        return {name: plain(part) for name, part in _parts(value)}
    if isinstance(value, str):
        return value if len(value) <= CUT else value[:CUT] + "..."
    if hasattr(value, "__len__"):
        few = STATUSES if len(value) and hasattr(value[0], "hardware_id") else FEW
        few = PAIRS if len(value) and hasattr(value[0], "key") else few
        listed = [plain(part) for part in value[:few]]
        return [*listed, "..."] if len(value) > few else listed
    return value.item() if hasattr(value, "item") else value


def _parts(message: Any) -> Iterator[tuple[str, Any]]:
    for name in (field.name for field in dataclasses.fields(message)):
        if not name.startswith("__") and not name.isupper():  # capitals are constants
            part = getattr(message, name)
            # A byte is printed as a character: that is how levels look on a terminal.
            yield name, chr(part) if name == "level" else part


if __name__ == "__main__":
    PAGE.write_text(examples(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
