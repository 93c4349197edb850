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

"""The full-screen console of several stands: a list, the worst first, from which one is opened."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from textual.app import ComposeResult
from textual.binding import Binding
from textual.screen import Screen
from textual.widgets import Footer, OptionList, Static

from flea_diag.nodes.operator.console_app import REDRAW_S, ConsoleScreen
from flea_diag.nodes.operator.console_bell import Bell
from flea_diag.nodes.operator.console_screen_app import ScreenApp
from flea_diag.nodes.operator.console_text import fill, highlighted, in_words, plain
from flea_diag.nodes.operator.desk import Desk
from flea_diag.nodes.operator.hall import Hall
from flea_diag.operator.hall_view import hall as listed
from flea_diag.operator.panel import Line
from flea_diag.operator.words import later


class OpenStand(ConsoleScreen):
    """The console of one stand; Escape leads back to the list, which rings for all."""

    BINDINGS = (*ConsoleScreen.BINDINGS, Binding("escape", "leave", later("All stands")))

    def ring(self) -> None:
        """Leave it to the list."""

    def action_leave(self) -> None:
        """Return to the list."""
        self.dismiss(None)


class HallScreen(Screen[None]):
    """Draws the list five times a second."""

    BINDINGS = (
        Binding("enter", "open", later("Open"), priority=True),
        Binding("q", "app.quit", later("Quit")),
    )

    def __init__(self, hall: Hall, ended: Callable[[], bool]) -> None:
        super().__init__()
        in_words(self)
        self._hall, self._ended, self._bell = hall, ended, Bell()
        self._rows: tuple[Line, ...] = ()

    def compose(self) -> ComposeResult:
        """Title, list, key bar."""
        yield Static(id="stands-title", classes="title")
        yield OptionList(id="stands")
        yield Footer()

    def on_mount(self) -> None:
        """Draw at once, then periodically."""
        self.redraw()
        self.set_interval(REDRAW_S, self.redraw)
        self.query_one("#stands").focus()

    def redraw(self) -> None:
        """Show the current states."""
        if self._ended():
            self.app.exit()
            return
        states = self._hall.states
        rings = {(name, a.key) for name, s in states.items() for a in s.alarms if a.rings}
        if self._bell.due(set(rings)):
            self.app.bell()
        panel = listed(states, Desk.now_ns())
        self.query_one("#stands-title", Static).update(plain(panel.title))
        if panel.lines != self._rows:
            self._rows = panel.lines
            fill(self.query_one("#stands", OptionList), panel.lines)

    def action_open(self) -> None:
        """Open the selected stand."""
        name = highlighted(self.query_one("#stands", OptionList))
        if name is not None:
            opened = OpenStand(self._hall.open(name), self._ended)
            self.app.push_screen(opened, lambda _: self._hall.close(name))


class HallApp(ScreenApp):
    """The console of several stands as a Textual application.

    Parameters
    ----------
    hall
        State and journal of every stand.
    ended
        Returns whether the node has ended; the screen then ends too.
    """

    def __init__(self, hall: Hall, ended: Callable[[], bool] = lambda: False) -> None:
        super().__init__(partial(HallScreen, hall, ended))
