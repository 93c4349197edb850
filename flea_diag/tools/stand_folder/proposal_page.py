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

"""The page of ``flea stand new``: what was taken for what, as text and as a mapping for JSON."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from flea_diag.tools.stand_folder.folder_files import shown_folder
from flea_diag.tools.stand_folder.proposal import ChannelProposal, StandProposal
from flea_diag.tools.stand_folder.seen_values import seen_values


def as_mapping(found: StandProposal) -> dict[str, Any]:
    """What was taken for what, with doubts, as a mapping for JSON."""
    keys = ("channel", "unit", "sign", "scale", "low", "high", "rate_hz", "hold", "confidence")
    channels = [
        {"source": each.source.name} | {key: getattr(each, key) for key in (*keys, "doubts")}
        for each in found.channels
    ]
    return {
        "template": found.template.name, "rate_hz": found.rate_hz,
        "joint": found.grid.joint, "joints": found.grid.joints, "channels": channels,
        "not_recorded": _missing(found), "not_used": dict(found.unused),
        "notes": [*found.grid.notes, *_doubts(found)], "seen": list(seen_values(found)),
    }  # fmt: skip


def _missing(found: StandProposal) -> list[str]:
    """Sensors of the template that the recording has not."""
    known = {each.channel for each in found.channels}
    return [name for name in found.template.model.sensors if name not in known]


def as_text(folder: Path, recording: Path, found: StandProposal) -> str:
    """One page: what was taken for what, what to check, and how to go on."""
    return "\n".join((*_taken(folder, found), *_told(found), *_next(folder, recording)))


def _taken(folder: Path, found: StandProposal) -> Iterator[str]:
    kind, rate = found.template, found.rate_hz
    yield f"{folder}: {kind.title} (template {kind.name}), {rate:g} scans a second{_joint(found)}"
    yield ""
    rows = [("channel", "source", "unit", "sign", "sure", "check"), *map(_cells, found.channels)]
    widths = [max(len(row[k]) for row in rows) for k in range(6)]
    for row in rows:
        cells = (f"{text:{width}}" for text, width in zip(row, widths, strict=True))
        yield f"  {'  '.join(cells)}".rstrip()
    yield ""


def _told(found: StandProposal) -> Iterator[str]:
    if missing := _missing(found):
        yield f"not recorded: {', '.join(missing)}"
    if found.unused:
        more = f" and {len(found.unused) - 8} more" if len(found.unused) > 8 else ""
        yield f"not used: {', '.join(name for name, _ in found.unused[:8])}{more}"
    yield from (f"note: {words}" for words in (*found.grid.notes, *_doubts(found)))
    yield from (f"seen: {words}" for words in seen_values(found))


def _next(folder: Path, recording: Path) -> Iterator[str]:
    name = shown_folder(folder)
    yield f"check in {name}/channels.yaml the lines that say check; positive must extend"
    yield f"check in {name}/actuator.yaml screw or gear ratio and travel"
    yield ""
    yield f"next: flea import --stand {name} {recording} -o bags"
    yield f"      flea calibrate bags/* --stand {name} -o {name}/calibration.yaml   (nominal bags)"
    yield f"      flea replay bags/NAME --stand {name}"


def _joint(found: StandProposal) -> str:
    joint, others = found.grid.joint, found.grid.joints
    if not joint:
        return ""
    of = f" of {', '.join(others[:8])} (--joint takes another)" if len(others) > 1 else ""
    return f", joint {joint}{of}"


def _cells(each: ChannelProposal) -> tuple[str, ...]:
    """Cells of a channel; what is doubtful is marked where it stands."""
    doubts = {words.partition(" ")[0] for words in each.doubts}
    source = each.source.name if len(each.source.name) <= 60 else f"...{each.source.name[-57:]}"
    texts = {"source": source, "unit": each.unit, "sign": "+" if each.sign > 0 else "-"}
    marked = [f"{text} (check)" if key in doubts else text for key, text in texts.items()]
    told = (d for d in each.doubts if " " in d or d not in texts)
    return (each.channel, *marked, f"{each.confidence:.0%}", ", ".join(told))


def _doubts(found: StandProposal) -> list[str]:
    """What is doubtful about the whole."""
    said = []
    if found.rivals:
        said.append(
            f"check: template {found.template.name}; {' or '.join(found.rivals)} fits as well "
            "(--template)"
        )
    if not found.moves:
        said.append(
            "check: nothing moves in this recording, so that neither signs nor units can be held "
            "against each other: take one with motion both ways"
        )
    return said
