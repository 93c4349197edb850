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

"""Lines of panels as Textual shows them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from rich.text import Text
from textual.screen import Screen
from textual.widgets import OptionList
from textual.widgets.option_list import Option

from flea_diag.errors import visible
from flea_diag.operator.panel import Line
from flea_diag.operator.words import tr
from flea_diag.wire.records import Level

STYLES = {
    None: "",
    Level.OK: "green",
    Level.WARN: "yellow",
    Level.ERROR: "bold red",
    Level.STALE: "bold magenta",
}
"""Colours repeat the text; no information is given by colour alone."""
CSS = """
#verdict { height: auto; padding: 0 1; }
#body { height: 1fr; }
#left, #right { width: 1fr; padding: 0 1; }
.-narrow #body { layout: vertical; overflow-y: auto; }
.-narrow #left, .-narrow #right { width: 1fr; height: auto; }
.panel { height: auto; margin-bottom: 1; text-wrap: nowrap; text-overflow: ellipsis; }
.title { text-style: bold; color: $accent; height: 1; }
OptionList { height: auto; border: none; padding: 0; background: transparent; }
OptionList > .option-list--option-highlighted { background: #10243a; text-style: bold; }
#why, #dropped, #next, #todo, #judged, #unseen { text-wrap: wrap; }
#bottom { height: auto; max-height: 10; padding: 0 1; }
#possible { margin-bottom: 1; }
#message { height: auto; padding: 0 1; color: $warning; }
Ask { align: center middle; }
Ask > * { width: 70%; }
"""


def plain(text: str) -> Text:
    """Text as it is: brackets in it are no markup of Textual's."""
    return Text(visible(text))


def styled(lines: tuple[Line, ...]) -> Text:
    """Lines in the colours of their levels."""
    text = Text()
    for number, line in enumerate(lines):
        text.append(("\n" if number else "") + visible(line.text), STYLES[line.level])
    return text


def in_words(screen: Screen[Any]) -> None:
    """Name the keys of a screen in its language; they were bound before it was known."""
    for bindings in screen._bindings.key_to_bindings.values():
        bindings[:] = [replace(key, description=tr(key.description)) for key in bindings]


def _parts(lines: tuple[Line, ...]) -> list[tuple[Line, ...]]:
    """Lines grouped into entries: a line with a key and the lines after it."""
    parts: list[tuple[Line, ...]] = []
    for line in lines:
        if line.key or not parts:
            parts.append((line,))
        else:
            parts[-1] += (line,)
    return parts


def highlighted(options: OptionList) -> str | None:
    """Key of the chosen entry."""
    place = options.highlighted
    return None if place is None else options.get_option_at_index(place).id


def fill(options: OptionList, lines: tuple[Line, ...]) -> None:
    """Replace the entries of a list; the chosen one stays chosen while it is there."""
    chosen = highlighted(options)
    options.clear_options()
    options.add_options([Option(styled(rows), id=rows[0].key) for rows in _parts(lines)])
    places = {option.id: place for place, option in enumerate(options.options)}
    options.highlighted = places.get(chosen, 0) if places else None
