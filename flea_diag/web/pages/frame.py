"""What every page has: the bar with its buttons, notices, a dialog for text, the list of keys."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from nicegui import Client, ui

from flea_diag.errors import visible
from flea_diag.web.pages.button import button
from flea_diag.web.pages.elements import STATIC, PanelBody, Watch

KEYS = (("d", "switch between light and dark"), ("?", "show this list"))
"""Keys of every page; those of its own come before them."""


class Frame:
    """One page in one browser; its own content is what ``actions`` and ``panels`` add.

    Parameters
    ----------
    client
        The browser.
    title
        Name in the bar, markup.
    keys
        Keys of this page with what they do.
    changed
        Called after what a person has done, to draw at once.
    """

    def __init__(
        self,
        client: Client,
        title: str,
        keys: Sequence[tuple[str, str]],
        changed: Callable[[], None],
    ) -> None:
        self.client, self._changed = client, changed
        self._dark = ui.dark_mode(None)
        ui.add_css(STATIC / "flea.css")
        with ui.element("div").classes("bar-top flea"):
            ui.html(title, sanitize=False, tag="span").classes("name")
            self.chips = PanelBody()
            ui.element("span").classes("room")
            with ui.element("div").classes("actions"):
                self.actions()
                button("Light / dark", "d", self._turn)
                button("Keys", "?", lambda: self._help.open())
        self._watch = Watch()
        with ui.element("main").classes("flea"):
            self.panels()
        self._text_dialog()
        with ui.dialog() as self._help, ui.card().classes("flea"):
            rows = "".join(f"<kbd>{key}</kbd><span>{words}</span>" for key, words in (*keys, *KEYS))
            ui.html(f"<div class=keys>{rows}</div>", sanitize=False)

    def actions(self) -> None:
        """Add the buttons of this page to the bar."""

    def panels(self) -> None:
        """Add the panels of this page."""

    def beat(self, ringing: int) -> None:
        """Tell the browser that the server lives, and how many alarms ring."""
        self._watch.run_method("beat", ringing)

    def ask(self, words: str, text: str, done: Callable[[str], None]) -> None:
        """Ask for a text, and do something with it."""
        self._asked.set_content(words)
        self._said.set_value(text)
        self._done = done
        self._dialog.open()

    def tell(self, words: str) -> None:
        """Say what was done, or why it was not."""
        trouble = self.trouble()
        ui.notify(visible(trouble or words), type="negative" if trouble else None)
        self._changed()

    def trouble(self) -> str:
        """Why what a person has entered cannot be stored; empty if it can."""
        return ""

    def _text_dialog(self) -> None:
        self._done: Callable[[str], None] = lambda _: None
        with ui.dialog() as self._dialog, ui.card().classes("flea"):
            self._asked = ui.html("", sanitize=False, tag="h3")
            self._said = ui.textarea().props("autofocus outlined").classes("said")
            self._said.on("keydown.enter.prevent", self._say)
            with ui.element("div").classes("actions"):
                button("Save", "Enter", self._say).classes("primary")
                button("Cancel", "Esc", self._dialog.close)

    def _say(self) -> None:
        self._dialog.close()
        if str(self._said.value or "").strip():
            self._done(str(self._said.value))
            self.tell("Saved.")

    def _turn(self) -> None:
        ui.run_javascript("return document.body.classList.contains('body--dark')").then(
            lambda dark: self._dark.set_value(not dark)
        )
