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

"""A dialog for a text, which the browser opens by itself."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from nicegui import ui

from flea_diag.operator.words import later, tr
from flea_diag.web.pages.elements import STATIC

LOST = later("The page is disconnected. Keep this open: it is saved as soon as the page is back.")
LONGEST = 2000
"""Characters that are taken of a text."""


@dataclass(frozen=True, slots=True)
class Said:
    """What a person has entered: on which alarm (empty: on none), and the entry chosen."""

    alarm: str
    text: str
    choice: str = ""


class TextDialog(ui.element, component=STATIC / "question.js"):
    """A dialog that buttons with ``data-opens`` open by its name.

    Parameters
    ----------
    name
        What ``data-opens`` calls it.
    words
        What is asked.
    done
        Takes what was entered; empty texts are not sent.
    opened
        Called with the alarm when it opens.
    """

    def __init__(
        self,
        name: str,
        words: str,
        done: Callable[[Said], None],
        *,
        field: str,
        preset: str = "",
        example: str = "",
        about: str = "",
        choices: Sequence[tuple[str, str]] = (),
        chosen: str = "",
        save: str = "",
        opened: Callable[[str], None] | None = None,
    ) -> None:
        super().__init__()
        given = {
            "name": name,
            "words": words,
            "field": field,
            "preset": preset,
            "example": example,
            "about": about,
            "choices": [[code, tr(words)] for code, words in choices],
            "chosen": chosen,
            "save_label": save or tr("Save"),
            "cancel_label": tr("Cancel"),
            "empty_label": tr("Enter a text first."),
            "lost_label": tr(LOST),
        }
        for key, value in given.items():
            self.props[key] = value
        self.on("said", lambda event: done(_said(event.args)))
        if opened is not None:
            self.on("opened", lambda event: opened(str(event.args or "")))


def _said(content: Any) -> Said:
    """What the browser has sent; whatever it is, it is text of a bounded length."""
    sent = content if isinstance(content, dict) else {}
    texts = (str(sent.get(key) or "")[:LONGEST] for key in ("alarm", "text", "choice"))
    return Said(*texts)
