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
