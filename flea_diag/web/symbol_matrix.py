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

"""Symbols over time: one row per deviating residual, one column per change."""

from __future__ import annotations

from collections.abc import Sequence

from flea_diag.operator.words import later, tr
from flea_diag.web.history import signs
from flea_diag.web.markup import Markup, joined, tag
from flea_diag.wire.records import AmbiguityGroup

WORDS = {
    "+": later("above"), "-": later("below"), "0": later("normal"), "?": later("unknown"),
    "*": later("any"),
}  # fmt: skip
GLYPH = {"+": "▲", "-": "▼", "0": "●", "?": "…", "*": "∗"}
CLASS = {"+": "plus", "-": "minus", "0": "zero", "?": "open", "*": "open"}
MOST_COLUMNS = 5
"""The first and the latest change."""


def symbol_matrix(group: AmbiguityGroup, residuals: Sequence[str]) -> Markup:
    """Table of the episode of this verdict; ``residuals`` are the names of all residuals.

    A cell shows magnitude and slope. Residuals without a symbol are listed below the table.
    """
    seen = signs(group)
    stamps = sorted({sign.stamp_ns for sign in seen})
    stamps = [*stamps[:1], *stamps[1:][1 - MOST_COLUMNS :]]
    names = list(dict.fromkeys(sign.source for sign in seen))
    head = tag(
        "tr",
        tag("th", tr("residual"), scope="col"),
        *(
            tag("th", f"+{(stamp - group.detected_stamp_ns) / 1e9:.2f} s", scope="col")
            for stamp in stamps
        ),
    )
    rows = []
    for name in names:
        changes = {sign.stamp_ns: sign.observed for sign in seen if sign.source == name}
        cells, held = [], ""
        for stamp in sorted(set(stamps) | set(changes)):
            new = changes.get(stamp, "")
            held = new or held
            if stamp in stamps:
                cells.append(_cell(held, fresh=bool(new)))
        rows.append(tag("tr", tag("th", name, scope="row"), *cells))
    quiet = [name for name in residuals if name not in names]
    below = tag(
        "details",
        tag("summary", tr("{count} residuals without a symbol in this episode", count=len(quiet))),
        tag("p", ", ".join(quiet), class_="quiet"),
        data_name="quiet",
    )
    return joined(tag("table", head, *rows, class_="symbols"), below if quiet else None)


def _cell(observed: str, fresh: bool) -> Markup:
    if len(observed) != 2:
        return tag("td", "")
    magnitude, slope = observed
    words = tr(
        "magnitude {magnitude}, slope {slope}",
        magnitude=tr(WORDS[magnitude]), slope=tr(WORDS[slope]),
    )  # fmt: skip
    return tag(
        "td",
        tag("b", GLYPH[magnitude], class_=CLASS[magnitude]),
        tag("span", f"{magnitude}{slope}"),
        title=words,
        class_="fresh" if fresh else None,
    )
