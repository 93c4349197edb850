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

"""Text of a proposed ``channels.yaml``: each guess with its reason beside it."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator

from flea_diag.tools.series.row_times import MADE_UP, RowTimes
from flea_diag.tools.stand_folder.proposal import ChannelProposal, StandProposal
from flea_diag.wire.yaml_text import parse_yaml

_PLAIN = re.compile(r"[A-Za-z_/][\w/.\[\]-]*")
_LEFT_OUT = 40
"""Series that are listed as not used."""


def channel_file(found: StandProposal) -> str:
    """Text of channels.yaml."""
    return "\n".join([*_head(found), "", "channels:", *_rows(found), *_unused(found)]) + "\n"


def yaml_text(text: str) -> str:
    """A text as YAML holds it, in quotes where it needs them."""
    if _PLAIN.fullmatch(text) and parse_yaml(text) == text:
        return text
    return json.dumps(text)


def _head(found: StandProposal) -> Iterator[str]:
    recording = _shown(found.grid.recorded.path.name)
    yield f"# Channels as `flea stand new` guessed them from {recording}."
    yield '# Every guess says so; what the recording does not tell for certain says "check".'
    yield "schema_version: 1"
    times = found.grid.times
    yield f"rate_hz: {found.rate_hz:g}  # guessed, because the readings come so"
    if times is not None and times.column:
        yield from _time(times)


def _time(times: RowTimes) -> Iterator[str]:
    start = f', start: "{times.start}"' if times.start else ""
    made_up = times.start == MADE_UP
    why = "it rises; the day of the start is made up" if made_up else "it holds times of day"
    yield (
        f"time: {{column: {json.dumps(times.column)}, unit: {times.unit}{start}}}"
        f"  # guessed, because {why}"
    )
    if times.split_by:
        keys = ", ".join(map(json.dumps, times.split_by))
        why = f"{times.column} begins anew where these change"
        yield f"# guessed: they tell the recordings apart, because {why}; check"
        yield f"split_by: [{keys}]"
    yield "# What recordings show, by the name of their bags; the first pattern that fits:"
    yield '# truth: {"normal*": nominal}'


def _rows(found: StandProposal) -> Iterator[str]:
    for each in found.channels:
        yield f"  {each.channel}:  # source and unit are {each.confidence:.0%} sure"
        for key, value, why, doubt in _keys(each, found):
            check = f"; check{f': {doubt}' if doubt != 'check' else ''}" if doubt else ""
            comment = f"  # guessed, because {_shown(why)}{check}" if why else ""
            yield f"    {key}: {value}{comment}" if value else f"    {key}:{comment}"
            if key == "sum":
                for series, sign in each.source.terms:
                    yield f"      - column: {yaml_text(series.words)}"
                    yield f"        sign: {sign}"


def _keys(each: ChannelProposal, found: StandProposal) -> Iterator[tuple[str, str, str, str]]:
    """Key, value, reason and doubt of each line of a channel."""
    reason = dict(guess.split(": ", 1) for guess in each.guesses)
    doubt = {words.partition(" ")[0]: words.partition(" ")[2] or "check" for words in each.doubts}
    if len(each.source.terms) > 1:
        yield "sum", "", reason["source"], doubt.get("source", "")
    else:
        place = each.source.terms[0][0].place
        for key, value in place.items():
            first = key in ("column", "topic")
            why = reason["source"] if first else ""
            yield key, yaml_text(value), why, doubt.get("source", "") if first else ""
    yield "unit", yaml_text(each.unit), reason["unit"], doubt.get("unit", "")
    yield "sign", str(each.sign), reason["sign"], doubt.get("sign", "")
    if "scale" in reason:
        yield "scale", f"{each.scale:.6g}", reason["scale"], "check"
    yield "range", f"[{each.low!r}, {each.high!r}]", "it leaves room about the readings", "check"
    if abs(each.rate_hz - found.rate_hz) > 0.01 * found.rate_hz:
        yield "rate_hz", f"{each.rate_hz:g}", "the readings come so", ""
    if each.age_s:
        yield "age_s", f"{each.age_s:g}", "readings come unevenly", ""
    if each.turn:
        yield "turn", f"{each.turn:.9g}", "it jumps back after each turn", ""
    if each.hold:
        yield "resample", "hold", "it comes far less often than scans", ""


def _unused(found: StandProposal) -> Iterator[str]:
    unused = found.unused
    if unused:
        yield ""
        yield "# Not used:"
        for name, reason in unused[:_LEFT_OUT]:
            yield f"# - {_shown(name)}: {reason}"
        if len(unused) > _LEFT_OUT:
            yield f"# - and {len(unused) - _LEFT_OUT} more"


def _shown(text: str) -> str:
    """A text in a comment: of one line, whatever a recording holds."""
    return "".join(c if c.isprintable() else "?" for c in text)
