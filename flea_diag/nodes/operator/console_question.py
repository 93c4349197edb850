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

"""Input dialog of the console: one line of text."""

from __future__ import annotations

from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding
from textual.screen import ModalScreen
from textual.widgets import Input, Label

from flea_diag.errors import visible
from flea_diag.nodes.operator.console_text import in_words
from flea_diag.operator.words import later


class Ask(ModalScreen[str]):
    """Asks for one line of text; Escape cancels."""

    BINDINGS = (Binding("escape", "leave", later("Cancel")),)

    def __init__(self, question: str, example: str) -> None:
        super().__init__()
        in_words(self)
        self._question, self._example = question, example

    def compose(self) -> ComposeResult:
        """Question and field."""
        yield Label(Text(visible(self._question)))
        yield Input(placeholder=self._example)

    def on_input_submitted(self, event: Input.Submitted) -> None:
        """Return the text on Enter."""
        self.dismiss(event.value)

    def action_leave(self) -> None:
        """Return nothing on Escape."""
        self.dismiss(None)
