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

"""What every page has: the bar with its buttons, notices, the list of keys."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from nicegui import Client, ui

from flea_diag.errors import visible
from flea_diag.operator.words import later, tr
from flea_diag.web.markup import Markup, joined, tag
from flea_diag.web.pages.button import button
from flea_diag.web.pages.elements import STATIC, PanelBody, Watch

KEYS = (("d", later("switch between light and dark")), ("?", later("show this list")))
"""Keys of every page; those of its own come before them."""

WATCHED = {
    "lost": later("✕ DISCONNECTED since {at} UTC: the content below is outdated. Reconnecting …"),
    "ringing": later("{count} not acknowledged"),
    "behind": later(
        "The clock of this browser is {minutes} min behind: all times shown are of the stand."
    ),
    "ahead": later(
        "The clock of this browser is {minutes} min ahead: all times shown are of the stand."
    ),
}
"""What the browser says by itself."""


BEAT_S = 0.25
"""What lives says so at least so often; the page takes two seconds of silence for a loss."""


class Frame:
    """One page in one browser; its own content is what ``actions``, ``more`` and ``panels`` add.

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

    title_tag = "div"
    """A page has one heading of the first order: its verdict, or else its name."""

    def __init__(
        self,
        client: Client,
        title: str,
        keys: Sequence[tuple[str, str]],
        changed: Callable[[], None],
    ) -> None:
        self.client, self._changed = client, changed
        self._told: tuple[int, str] | None = None
        self._beaten_s = 0.0
        ui.add_css(STATIC / "uplot" / "uPlot.css")
        ui.add_css(STATIC / "flea.css")
        with ui.element("header").classes("bar-top flea"):
            ui.html(title, sanitize=False, tag=self.title_tag).classes("name")
            self.chips = PanelBody()
            with ui.element("div").classes("actions"):
                self.actions()
                button(tr("More"), more="").classes("opener").props("aria-expanded=false")
                with ui.element("div").classes("rest"):
                    self.more()
                    button(tr("Light / dark"), "d", turn="")
                    button(tr("Keys"), "?", opens="keys")
        self._watch = Watch()
        self._watch.props["words"] = {name: tr(words) for name, words in WATCHED.items()}
        with ui.element("div").classes("flea sheet"):
            self.panels()
        self._list_of_keys((*keys, *KEYS))

    def actions(self) -> None:
        """Add the buttons of this page to the bar."""

    def more(self) -> None:
        """Add the buttons that a narrow bar keeps in a menu."""

    def panels(self) -> None:
        """Add the panels of this page."""

    def beat(self, ringing: int, spoken: str) -> None:
        """Tell the browser that the server lives, how many alarms ring, what to read aloud.

        The time goes with it: a browser with another clock says so.
        """
        now_s = time.monotonic()
        if self._told == (ringing, spoken) and now_s - self._beaten_s < BEAT_S:
            return
        self._told, self._beaten_s = (ringing, spoken), now_s
        self._watch.run_method("beat", ringing, spoken, round(time.time() * 1000.0))

    def tell(self, words: str) -> None:
        """Say what was done, or why it was not."""
        trouble = self.trouble()
        ui.notify(visible(trouble or words), type="negative" if trouble else None)
        self._changed()

    def trouble(self) -> str:
        """Why what a person has entered cannot be stored; empty if it can."""
        return ""

    def _list_of_keys(self, keys: Sequence[tuple[str, str]]) -> None:
        rows = (joined(tag("dt", tag("kbd", key)), tag("dd", tr(words))) for key, words in keys)
        close = Markup('<button type="submit">{}</button>').format(tr("Close"))
        content = tag("form", tag("h2", tr("Keys")), tag("dl", *rows, class_="keys"), close)
        with ui.element("dialog").classes("flea") as element:
            element.props["data-name"] = "keys"
            element.props["aria-label"] = tr("Keys")
            ui.html(str(content).replace("<form>", '<form method="dialog">', 1), sanitize=False)
