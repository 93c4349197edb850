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

"""The full-screen console in Textual: the panels of the view, two of them selectable lists."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding
from textual.containers import Horizontal, VerticalScroll
from textual.screen import Screen
from textual.widgets import Footer, OptionList, Static

from flea_diag.errors import visible
from flea_diag.nodes.operator.console_bell import Bell
from flea_diag.nodes.operator.console_question import Ask
from flea_diag.nodes.operator.console_screen_app import ScreenApp
from flea_diag.nodes.operator.console_text import (
    STYLES,
    fill,
    highlighted,
    in_words,
    plain,
    styled,
)
from flea_diag.nodes.operator.desk import Desk
from flea_diag.operator.alarm import Alarm
from flea_diag.operator.alarm_view import alarms as listed
from flea_diag.operator.alarm_view import detail, key_text
from flea_diag.operator.judgement_view import judged_table
from flea_diag.operator.panel import Line, Panel
from flea_diag.operator.shift.alarm_filter import EVERY, FILTERS, after
from flea_diag.operator.unit_decision import ASKED, EXAMPLE, unit_in_question
from flea_diag.operator.verdict_view import level_of, why
from flea_diag.operator.view import view
from flea_diag.operator.words import later, tr
from flea_diag.wire.records import AmbiguityGroup, Level

REDRAW_S = 0.2
MOST_DIGITS = 6

LEFT = ("todo", "possible", "growth", "why", "next", "steps", "dropped", "unseen")
RIGHT = ("symbols", "features", "residuals", "streams", "channels", "judged", "nodes", "marks")
SIGNALS = ("symbols", "features", "residuals", "streams")
"""What makes room for the table of all tests."""
LISTS = ("possible", "episodes")


class ConsoleScreen(Screen[None]):
    """Draws the state of the desk five times a second; keys acknowledge, comment, mark, inject."""

    HORIZONTAL_BREAKPOINTS = [(0, "-narrow"), (120, "-wide")]  # noqa: RUF012
    BINDINGS = (
        Binding("a", "acknowledge", later("Acknowledge")),
        Binding("c", "comment", later("Comment")),
        Binding("z", "withdraw", later("Undo")),
        Binding("s", "shelve", later("Shelve")),
        Binding("o", "service", later("Service")),
        Binding("f", "filter", later("Filter")),
        Binding("m", "mark", later("Mark")),
        Binding("j", "judged", later("Judged")),
        Binding("u", "accept_unit", later("Accept unit")),
        Binding("i", "inject", later("Inject (simulated)")),
        Binding("tab", "app.focus_next", later("Next list")),
        Binding("q", "app.quit", later("Quit")),
    )

    def __init__(self, desk: Desk, ended: Callable[[], bool]) -> None:
        super().__init__()
        in_words(self)
        self._desk, self._ended = desk, ended
        self._offered = (False, False)
        self._bell = Bell()
        self._said = ""
        self._rows: dict[str, tuple[Line, ...]] = {}
        self._filter, self._all_judged = EVERY, False

    def compose(self) -> ComposeResult:
        """Verdict, two columns of panels, episodes, key bar."""
        yield Static(id="verdict")
        with Horizontal(id="body"):
            for column, names in (("left", LEFT), ("right", RIGHT)):
                with VerticalScroll(id=column, can_focus=False):
                    yield from (widget for name in names for widget in _block(name))
        with VerticalScroll(id="bottom", can_focus=False):
            yield from _block("episodes")
        yield Static(id="message")
        yield Footer()

    def on_mount(self) -> None:
        """Draw at once, then periodically."""
        self.redraw()
        self.set_interval(REDRAW_S, self.redraw)
        self.query_one("#possible").focus()

    def redraw(self) -> None:
        """Show the current state."""
        if self._ended():
            self.app.exit()
            return
        self._offer()
        self.ring()
        state = self._desk.state
        shown = {panel.name: panel for panel in view(state, self._desk.now_ns())}
        if (found := listed(state, self._filter)) is not None:
            shown["episodes"] = found
        if self._all_judged and (table := judged_table(state, self._desk.now_ns())) is not None:
            shown = {name: panel for name, panel in shown.items() if name not in SIGNALS}
            shown["judged"] = table
        chosen = self._chosen_member()
        if chosen is not None:
            shown["why"] = why(chosen)
        self._verdict(shown.pop("verdict"))
        for name in (*LEFT, *RIGHT, "episodes"):
            self._panel(name, shown.get(name))
        self.query_one("#message", Static).update(plain(self._desk.trouble or self._said))

    def _offer(self) -> None:
        """Show the keys of what can be done only now."""
        unit = unit_in_question(self._desk.state)
        offered = self._desk.faults.present, unit is not None
        if self._offered != offered:
            self._offered = offered
            self.refresh_bindings()

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool:
        """Whether a key is active now."""
        takes_faults, in_question = self._offered
        return {"inject": takes_faults, "accept_unit": in_question}.get(action, True)

    def _verdict(self, panel: Panel) -> None:
        group = self._desk.state.group
        silent = self._desk.state.silent(AmbiguityGroup, self._desk.now_ns())
        level = Level.STALE if silent or group is None else level_of(group)
        text = Text()
        text.append(f" {visible(panel.title)} ", f"{STYLES[level]} reverse")
        for line in panel.lines:
            text.append("\n" + visible(line.text), STYLES[line.level])
        self.query_one("#verdict", Static).update(text)

    def _panel(self, name: str, panel: Panel | None) -> None:
        title = self.query_one(f"#{name}-title", Static)
        title.display = panel is not None
        body = self.query_one(f"#{name}")
        body.display = panel is not None
        if panel is None:
            return
        title.update(plain(panel.title))
        if isinstance(body, OptionList):
            self._options(name, body, panel.lines)
        elif isinstance(body, Static):
            body.display = bool(panel.lines)
            body.update(styled(panel.lines))

    def _options(self, name: str, body: OptionList, lines: tuple[Line, ...]) -> None:
        if self._rows.get(name) == lines:
            return
        self._rows[name] = lines
        fill(body, lines)

    def ring(self) -> None:
        """Ring for a new alarm of the stand at once, then repeatedly until all are acknowledged."""
        if self._bell.due({alarm.key for alarm in self._desk.state.alarms if alarm.rings}):
            self.app.bell()

    # -- selection and operator actions

    def _chosen_member(self) -> object:
        group = self._desk.state.group
        members = group.members if group is not None else ()
        chosen = highlighted(self.query_one("#possible", OptionList))
        return next((m for m in members if m.fault == chosen), members[0] if members else None)

    def _chosen_alarm(self) -> Alarm | None:
        """The alarm under the cursor, or the latest one not acknowledged."""
        alarms = self._desk.state.alarms
        episodes = self.query_one("#episodes", OptionList)
        if episodes.has_focus:
            chosen = highlighted(episodes)
            return next((alarm for alarm in alarms if key_text(alarm.key) == chosen), None)
        standing = [alarm for alarm in alarms if alarm.standing] or list(alarms)
        return standing[-1] if standing else None

    def action_acknowledge(self) -> None:
        """Acknowledge the selected alarm."""
        alarm = self._chosen_alarm()
        if alarm is None:
            self._tell(tr("no alarm to acknowledge"))
            return
        self._desk.acknowledge(alarm.key)
        self.redraw()

    def action_comment(self) -> None:
        """Ask for a comment on the selected alarm."""
        alarm = self._chosen_alarm()
        if alarm is None:
            self._tell(tr("no alarm to comment on; press m to mark this moment instead"))
            return
        question = detail(alarm).title
        self.app.push_screen(
            Ask(tr("Comment on {alarm}", alarm=question), tr("finding, action taken")),
            lambda text: self._desk.comment(alarm.key, text) if text else None,
        )

    def action_withdraw(self) -> None:
        """Withdraw the latest acknowledgement, as long as it can be."""
        undoable = [alarm for alarm in self._desk.state.alarms if alarm.undoable]
        if not undoable:
            self._tell(tr("no acknowledgement of the last 10 s to withdraw"))
            return
        self._desk.withdraw(max(undoable, key=lambda alarm: alarm.acknowledged_ns).key)
        self.redraw()

    def action_shelve(self) -> None:
        """Ask for how long the selected alarm is shelved, and why."""
        alarm = self._chosen_alarm()
        if alarm is None:
            self._tell(tr("no alarm to shelve"))
            return

        def shelved(text: str | None) -> None:
            minutes, _, reason = (text or "").strip().partition(" ")
            if minutes.isdecimal() and len(minutes) < MOST_DIGITS and (reason or minutes == "0"):
                self._desk.shelve(alarm.key, int(minutes), reason)
            elif text:
                self._tell(
                    tr("not shelved: {text} is no number of minutes and a reason", text=repr(text))
                )

        question = Ask(tr("Shelve this alarm: minutes, reason"), tr("60 part ordered"))
        self.app.push_screen(question, shelved)

    def action_service(self) -> None:
        """Ask why the alarms of this stand go out of service, or come back."""

        def told(text: str | None) -> None:
            where, _, reason = (text or "").strip().partition(" ")
            if where in ("out", "in") and reason:
                self._desk.set_service(where == "out", reason)
            elif text:
                self._tell(tr("{text} is not 'out' or 'in' and a reason", text=repr(text)))

        question = Ask(tr("Alarms of this stand: out or in, why"), tr("out maintenance"))
        self.app.push_screen(question, told)

    def action_filter(self) -> None:
        """Show other alarms in the list."""
        self._filter = after(self._filter)
        self._tell(tr("episodes: {filter}", filter=tr(FILTERS[self._filter][0])))
        self.redraw()

    def action_judged(self) -> None:
        """Show every test with its shares of judgement, or what was not judged alone."""
        self._all_judged = not self._all_judged
        self.redraw()

    def action_mark(self) -> None:
        """Ask for the text of a mark; its stamp is the moment of the key press."""
        moment_ns = self._desk.moment_ns()

        def kept(text: str | None) -> None:
            if text:
                self._desk.mark(text, moment_ns)
                self._tell(tr("marked: {text}", text=text))

        self.app.push_screen(Ask(tr("Mark this moment"), tr("load changed")), kept)

    def action_accept_unit(self) -> None:
        """Ask why the unit on the stand is healthy; its difference stands in the verdict."""

        def decided(text: str | None) -> None:
            self._desk.decide_on_unit(text or "")

        self.app.push_screen(Ask(tr(ASKED), tr(EXAMPLE)), decided)

    def action_inject(self) -> None:
        """Ask for a fault to inject into a simulated stand."""
        question = tr("Inject a fault into the simulated stand")
        example = tr("jam, or with a size jam:0.5; 'clear' removes all faults")
        self.app.push_screen(Ask(question, example), self._put_in)

    def _put_in(self, text: str | None) -> None:
        if not text:
            return
        fault = "" if text.strip() == "clear" else text.strip()
        self._tell(tr("requested from the stand: {fault}", fault=repr(fault)))
        self._desk.faults.set(fault, lambda why_not: self._tell(_outcome(fault, why_not)))

    def _tell(self, text: str) -> None:
        self._said = text


class ConsoleApp(ScreenApp):
    """The console of one stand as a Textual application.

    Parameters
    ----------
    desk
        State and journal of the stand.
    ended
        Returns whether the node has ended; the screen then ends too.
    """

    def __init__(self, desk: Desk, ended: Callable[[], bool] = lambda: False) -> None:
        super().__init__(partial(ConsoleScreen, desk, ended))


def _block(name: str) -> tuple[Static | OptionList, ...]:
    body = OptionList(id=name) if name in LISTS else Static(id=name, classes="panel")
    return Static(id=f"{name}-title", classes="title"), body


def _outcome(fault: str, why_not: str) -> str:
    if why_not:
        return tr("Not injected: {why}", why=why_not)
    return tr("the stand accepted {fault}; see the truth line", fault=repr(fault))
