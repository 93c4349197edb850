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

"""A shift on the simulated stand, faster than real time, before the page in a real browser.

Stand, diagnosis, journal, report and page are those of a live run; only time runs faster, and what
a person at the stand does is scripted: to acknowledge, undo, shelve, comment and mark, to restart
the page and the diagnosis, also while an alarm stands, and to put browser and stand to sleep,
briefly and for long.
"""

from __future__ import annotations

import os
import re
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from flea_diag.configuration.component import make_pipeline
from flea_diag.configuration.stand import load_stand
from flea_diag.nodes.operator.alarm_journal import AlarmJournal
from flea_diag.nodes.operator.desk import Desk
from flea_diag.operator.alarm import Alarm
from flea_diag.operator.panel import clock
from flea_diag.operator.shift.shift_report import shift_report
from flea_diag.tools.replay.report import shift as replayed
from flea_diag.wire.bags.scan_columns import scan_block
from flea_diag.wire.blocks import Block
from flea_diag.wire.messages.codec import encode
from flea_diag.wire.records import (
    NEVER_NS,
    AmbiguityGroup,
    ChannelTable,
    Outcome,
    Record,
    Scan,
)
from flea_sim_driver.scenario.scenario_file import scenario_from_mapping
from flea_sim_driver.stand import SimulatedStand
from support.browser import Browser
from support.screens.page_session import TITLE

USUAL = float("nan")
FAULTS = (
    ("jam", USUAL), ("motor_current_bias", USUAL), ("winding_short", USUAL),
    ("load_force_bias", USUAL), ("motor_current_dead", USUAL), ("ball_nut_friction", 15.0),
    ("motor_speed_scaling", USUAL), ("actuator_position_bias", USUAL),
    ("motor_current_noise", USUAL), ("jam", USUAL), ("winding_short", USUAL),
    ("load_force_bias", USUAL),
)  # fmt: skip
"""Fault and size: such as are found within a minute without accelerometers."""
EVERY_S, FIRST_S, LASTS_S, QUIET_S = 600.0, 300.0, 60.0, 120.0
"""Period of the faults, when the first comes, how long each lasts, and may be open after it."""
SLEEP_S, LONG_SLEEP_S = 20.0, 300.0
"""Stand time for which the stand sends nothing."""
ASLEEP_S = 20.0
"""Time of the clock for which the browser sleeps: many times what the page waits for it."""
BLOCK_SCANS = 100
RESTARTED = 3
"""Fault after which the diagnosis is restarted."""
PAGE_BYTES = os.sysconf("SC_PAGE_SIZE")
STALE_S = 4.0
SIGHT_S = 60.0
ROWS = """[...document.querySelectorAll('#panel-episodes [data-is]')].map(
  (e) => e.closest('tr').innerText)"""
TIME = re.compile(r"\d\d:\d\d:\d\d")
OUTCOME = re.compile(rf"\b({'|'.join(Outcome)})\b")
LOOK_S = 0.2
"""Period at which the page is looked at until it has caught up."""


@dataclass
class Found:
    """What came of a shift."""

    stand_h: float = 0.0
    wall_s: float = 0.0
    alarms: int = 0
    named: list[str] = field(default_factory=list)
    missed: list[str] = field(default_factory=list)
    false_alarms: list[str] = field(default_factory=list)
    differences: list[str] = field(default_factory=list)
    server_mb: list[float] = field(default_factory=list)
    page_mb: list[float] = field(default_factory=list)


@dataclass
class Served:
    """A page on a journal, as a process of its own would have it."""

    desk: Desk
    url: str
    close: Callable[[], None]


class Shift:
    """One shift.

    Parameters
    ----------
    serve
        Starts the page on this desk.
    browser
        Shows it.
    journal
        Its file, which survives every restart.
    count
        Number of faults.
    first
        What happens during the first fault: a place in ``MEANWHILE``.
    """

    def __init__(
        self,
        serve: Callable[[Desk], Served],
        browser: Browser,
        journal: Path,
        count: int,
        first: int = 0,
    ) -> None:
        self.found = Found()
        self._serve, self._browser, self._journal, self._count = serve, browser, journal, count
        self._first = first
        values = {
            "motion": {
                "kind": "sine", "amplitude_m": 0.018, "frequency_hz": 0.5, "centre_m": 0.045
            },
            "load": {"constant_n": 20.0, "amplitude_n": 80.0, "frequency_hz": 0.2},
            "duration_s": EVERY_S * count,
            "seed": 4,
            "sensors": {"vibration": False},
        }  # fmt: skip
        self._stand = SimulatedStand(scenario_from_mapping(values, "shift"), time.time_ns())
        self._pipeline = make_pipeline(load_stand())
        self._kept: list[Record] = []
        self._waiting: list[Scan] = []
        self._open: AmbiguityGroup | None = None
        self._members: set[str] = set()
        self._fault = ""
        self._asleep: list[int] = []
        self._latched: dict[type, Record] = {}
        self._start()

    # -- what runs

    def _start(self) -> None:
        desk = Desk(AlarmJournal(self._journal), "Ada")
        desk.on_remark.append(self._kept.append)
        for record in self._latched.values():
            desk.take(record)
        self._page = self._serve(desk)
        self._browser.open(self._page.url)

    def run(self) -> Found:
        """The whole shift."""
        begin_s, steps = time.monotonic(), iter(self._script())
        due_s, step = next(steps)
        while not self._stand.finished:
            while self._stand.time_s >= due_s:
                step()
                due_s, step = next(steps, (float("inf"), lambda: None))
            for record in self._stand.advance():
                self._hand_on(record)
        self._diagnose()
        self._sight()
        self.found.stand_h = self._stand.time_s / 3600.0
        self.found.wall_s = time.monotonic() - begin_s
        self._page.close()
        return self.found

    def _hand_on(self, record: Record) -> None:
        if not isinstance(record, Scan):
            self._diagnose()
            self._take((record, *self._pipeline.handle(record)))
            return
        self._waiting.append(record)
        if len(self._waiting) >= BLOCK_SCANS:
            self._diagnose()

    def _diagnose(self) -> None:
        scans, self._waiting = self._waiting, []
        if not scans:
            return
        for scan in scans:
            self._page.desk.take(scan)
        block = scan_block([encode(scan) for scan in scans])
        assert block is not None
        self._take(self._pipeline.handle_block(block))

    def _take(self, said: tuple[Record | Block, ...]) -> None:
        for record in said:
            if isinstance(record, Block):
                continue
            self._kept.append(record)
            self._latched[type(record)] = record
            self._page.desk.take(record)
            if isinstance(record, AmbiguityGroup):
                self._judged(record)
        self._page.desk.tick()

    def _judged(self, group: AmbiguityGroup) -> None:
        if group.detected_stamp_ns != NEVER_NS:
            self._members |= {member.fault for member in group.members}
            new = self._open is None or self._open.detected_stamp_ns != group.detected_stamp_ns
            if new and not self._fault:
                at = f"{clock(group.detected_stamp_ns)} {group.words}"
                self.found.false_alarms.append(at)
            self._open = group
        else:
            self._open = None

    # -- what the script does

    def _script(self) -> Iterator[tuple[float, Callable[[], None]]]:
        """Moments of the stand and what happens then, in order."""
        for k in range(self._count):
            at_s = FIRST_S + EVERY_S * k
            yield at_s, lambda k=k: self._inject(k)  # type: ignore[misc]
            yield at_s + 0.4 * LASTS_S, self._meanwhile(k)
            clear_s = self._stand.time_s + 0.6 * LASTS_S  # the stand may have slept
            yield clear_s, self._clear
            yield clear_s + 20.0, lambda k=k: self._act(k)  # type: ignore[misc]
            yield clear_s + QUIET_S, self._end
            if k == RESTARTED:
                yield clear_s + 1.5 * QUIET_S, self._restart_quiet

    def _meanwhile(self, number: int) -> Callable[[], None]:
        """What happens while an alarm stands."""
        return self.MEANWHILE[(number + self._first) % len(self.MEANWHILE)].__get__(self)

    def _inject(self, number: int) -> None:
        self._diagnose()
        self._fault, size = FAULTS[number % len(FAULTS)]
        self._members = set()
        self._stand.inject(self._fault, size)

    def _clear(self) -> None:
        self._diagnose()
        self._stand.clear()

    def _end(self) -> None:
        """Whether the fault was found; an episode that is still open is reset, as people do."""
        self._diagnose()
        told = f"{self._fault} at {self._stand.time_s / 3600.0:.2f} h"
        (self.found.named if self._fault in self._members else self.found.missed).append(told)
        if self._open is not None:
            self._take(self._pipeline.reset())
        self._fault = ""
        self._sight()

    def _act(self, number: int) -> None:
        """A person does to the latest alarm what there is to do."""
        self._diagnose()
        desk = self._page.desk
        if not desk.state.alarms:
            return
        key = desk.state.alarms[-1].key
        desk.comment(key, f"seen, number {number}")
        desk.mark(f"looked at the stand, {number}", desk.moment_ns())
        desk.acknowledge(key)
        if number % 3 == 1:
            desk.withdraw(key)
            desk.shelve(key, 60, "part ordered")
        if number % 3 == 2:
            desk.withdraw(key)
            desk.acknowledge(key)

    def _nothing(self) -> None:
        """An alarm as any other."""

    def _restart_page(self) -> None:
        """While an alarm stands; the browser connects to the new one by itself where it can."""
        self._diagnose()
        self._page.close()
        self._start()

    def _restart_quiet(self) -> None:
        """While nothing is wrong; it is told of the channels anew, as by the latched topic."""
        self._restart_with(ChannelTable)

    def _restart_diagnosis(self) -> None:
        """While an alarm stands; it goes on from the last verdict, as a live one does."""
        self._restart_with(AmbiguityGroup, ChannelTable)

    def _restart_with(self, *latched: type) -> None:
        self._diagnose()
        self._pipeline = make_pipeline(load_stand())
        for kind in latched:
            self._take(self._pipeline.handle(self._latched[kind]))

    def _sleep_stand(self) -> None:
        self._silence(SLEEP_S)

    def _sleep_stand_long(self) -> None:
        self._silence(LONG_SLEEP_S)

    def _silence(self, length_s: float) -> None:
        """Nothing arrives; the page says so, and the alarm stays."""
        self._diagnose()
        woken_s = self._stand.time_s + length_s
        while self._stand.time_s < woken_s:
            self._stand.advance()
        until_s = time.monotonic() + STALE_S
        self._browser.until("!document.querySelector('.chip.live')", SIGHT_S)
        while time.monotonic() < until_s and self._browser.text(".chip.live"):
            pass

    def _sleep_browser(self) -> None:
        """Its processes stand still, as in a notebook that is closed, and go on later."""
        service = self._browser.driver.service.process.pid
        self._asleep = descendants(service)
        for pid in self._asleep:
            os.kill(pid, signal.SIGSTOP)

    def _sleep_browser_long(self) -> None:
        """Longer than the page waits for a browser that has gone."""
        self._diagnose()
        self._sleep_browser()
        threading.Event().wait(ASLEEP_S)
        self._wake_browser()

    def _wake_browser(self) -> None:
        for pid in self._asleep:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGCONT)
        self._asleep = []

    MEANWHILE = (
        _nothing, _restart_page, _sleep_browser, _restart_diagnosis, _sleep_stand,
        _sleep_browser_long, _sleep_stand_long, _restart_diagnosis,
    )  # fmt: skip

    # -- what must agree

    def _sight(self) -> None:
        """Journal, page, report and recording say the same, to the second."""
        self._wake_browser()
        desk = self._page.desk
        desk.tick()
        journal = AlarmJournal(self._journal)
        kept = journal.alarms()
        journal.close()
        self.found.alarms = len(kept)
        wanted = [_facts(alarm) for alarm in kept]
        self._agree("screen", wanted, [_facts(alarm) for alarm in desk.state.alarms])
        page = self._page_rows(wanted)
        self._agree("page", wanted, page)
        self._agree("report", wanted, self._report_rows())
        told = replayed(self._kept)
        self._agree("recording", wanted, [_facts(alarm) for alarm in told.alarms])
        memory = int(Path("/proc/self/statm").read_text("ascii").split()[1]) * PAGE_BYTES / 1e6
        self.found.server_mb.append(round(memory, 1))
        self.found.page_mb.append(round(self._browser.heap_bytes() / 1e6, 2))

    def _page_rows(self, wanted: list[str]) -> list[str]:
        """Rows of the page, once it has caught up."""
        until_s = time.monotonic() + SIGHT_S
        while True:
            rows = sorted(_row(text) for text in self._browser.run(ROWS))
            if rows == sorted(wanted) or time.monotonic() > until_s:
                return rows
            threading.Event().wait(LOOK_S)

    def _report_rows(self) -> list[str]:
        report = shift_report({TITLE: self._page.desk.state}, TITLE, time.time_ns())
        table = report.partition("<h2>Alarms</h2>")[2].partition("</table>")[0]
        rows = re.findall(r"<tr>(<td>.*?)</tr>", table, re.DOTALL)
        return [_row(re.sub(r"<[^>]+>", "\t", row)) for row in rows]

    def _agree(self, who: str, wanted: list[str], said: list[str]) -> None:
        different = sorted(set(wanted) ^ set(said))
        at = f"{self._stand.time_s / 3600.0:.2f} h"
        self.found.differences += [f"{at} {who}: {row}" for row in different]


def _parents() -> Iterator[tuple[int, int]]:
    """Every process with the one that has started it."""
    for path in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            fields = path.read_text("utf-8", "replace").rpartition(")")[2].split()
            yield int(path.parent.name), int(fields[1])


def descendants(pid: int) -> list[int]:
    """Processes that this one has started, and those that they have."""
    children = [child for child, parent in _parents() if parent == pid]
    return [*children, *(each for child in children for each in descendants(child))]


def _facts(alarm: Alarm) -> str:
    """What every account of an alarm must have alike: times to the second, verdict, remarks."""
    returned = clock(alarm.closed_ns)[:8] if alarm.closed_ns != NEVER_NS else ""
    acknowledged = clock(alarm.acknowledged_ns)[:8] if not alarm.standing else ""
    said = sorted(comment.text for comment in alarm.comments)
    done = sorted(action.kind.value for action in alarm.actions)
    facts = (clock(alarm.detected_ns)[:8], alarm.outcome.value, returned, acknowledged)
    return " | ".join((*facts, ",".join(said), ",".join(done)))


def _row(text: str) -> str:
    """The same facts, read from the words of a row of the page or of the report."""
    times = TIME.findall(text)
    outcome = OUTCOME.search(text)
    returned = re.search(r"returned (\d\d:\d\d:\d\d)", text)
    acknowledged = re.search(r"acknowledged (\d\d:\d\d:\d\d)", text) or _cell(text)
    comments = sorted(re.findall(r"seen, number \d+", text))
    kinds = ("acknowledgement withdrawn", "shelved", "unshelved")
    done = sorted(kind for kind in kinds for _ in re.findall(rf": {kind}", text))
    facts = (times[0], outcome[1] if outcome else "", returned[1] if returned else "")
    return " | ".join(
        (*facts, acknowledged[1] if acknowledged else "", ",".join(comments), ",".join(done))
    )


def _cell(text: str) -> Any:
    """Who acknowledged when, from the cell of the report that says nothing else."""
    return re.search(r"\t\d{4}-\d\d-\d\d (\d\d:\d\d:\d\d) UTC Ada\t", text)


@contextmanager
def shift_of(folder: Path, count: int, first: int = 0) -> Iterator[Shift]:
    """A shift in a folder of its own."""
    from nicegui import Client
    from nicegui.testing.general import nicegui_reset_globals

    from flea_diag.nodes.operator.web import picture_tools
    from flea_diag.web.pages.site import Site
    from flea_diag.web.server import Server
    from support.browser import chromium

    tools = picture_tools("flea")

    def serve(desk: Desk) -> Served:
        reset = nicegui_reset_globals()
        reset.__enter__()
        Site().serve_stand(desk, tools, TITLE)
        server = Server(TITLE, "127.0.0.1", 0, token="")
        server.start()

        def close() -> None:
            server.close()
            desk.close()
            Client.page_routes.clear()
            reset.__exit__(None, None, None)

        return Served(desk, f"http://127.0.0.1:{server.port}/", close)

    with chromium() as browser:
        yield Shift(serve, browser, folder / "alarms.sqlite", count, first)
