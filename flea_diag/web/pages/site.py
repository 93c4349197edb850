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

"""The pages of one stand or of all, and the task that updates them.

One task draws for all browsers, ten times a second and at once after a detection. Each browser is
sent the changes, and the rows of numbers that it does not have yet.
"""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from fastapi.responses import RedirectResponse, Response
from nicegui import Client, app, ui

from flea_diag.web.guard import STAND_PATH
from flea_diag.web.markup import joined
from flea_diag.web.pages.diagnosis_page import OperatorNode
from flea_diag.web.pages.report import serve_report
from flea_diag.web.pages.rooms import HallRoom, StandRoom, Stands
from flea_diag.web.view import Tools

PERIOD_S = 0.1
CONNECT_S = 15.0
"""Time within which a browser that has loaded the page must connect, or reload it."""
MOST_KINDS = 10
"""Kinds of error that are reported."""


class Site:
    """All open pages, and the task that updates them.

    Parameters
    ----------
    say
        Takes what the operator must know, one line each.
    """

    def __init__(self, say: Callable[[str], None] = lambda _: None) -> None:
        self._room: StandRoom | HallRoom | None = None
        self._say = say
        self._reported: set[str] = set()
        self._woken = asyncio.Event()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._expired_s = 0.0
        app.on_startup(self._run)
        app.on_delete(self._leave)

    def serve_stand(
        self, desk: OperatorNode, tools: Tools, title: str, facts: Sequence[tuple[str, str]] = ()
    ) -> None:
        """Serve the page of one stand, and the report of its shift; ``facts`` are lines of that."""
        room = self._room = StandRoom(desk, tools, joined(title), self.wake)

        def page(client: Client) -> None:
            room.enter(client)

        ui.page("/", title=title)(page)
        serve_report(lambda: {title: desk.state}, title, facts)

    def serve_hall(
        self,
        hall: Stands,
        tools_of: Callable[[str], Tools],
        title: str,
        facts: Sequence[tuple[str, str]] = (),
    ) -> None:
        """Serve the list of all stands, the page of each, and the reports of their shifts."""
        room = self._room = HallRoom(hall, tools_of, joined(title), self.wake)

        def page(client: Client) -> None:
            room.enter(client)

        def stand_page(client: Client, name: str) -> Response | None:
            ui.page_title(f"flea_diag · {name}")
            return None if room.enter_stand(client, name) else RedirectResponse("/")

        ui.page("/", title=title)(page)
        ui.page(STAND_PATH + "{name:path}")(stand_page)
        serve_report(lambda: {name: desk.state for name, desk in hall.desks.items()}, title, facts)

    def wake(self) -> None:
        """Draw now; callable from any thread."""
        if self._loop is not None:
            self._loop.call_soon_threadsafe(self._woken.set)

    def _leave(self, client: Client) -> None:
        if self._room is not None:
            self._room.leave(client.id)

    def _update(self) -> None:
        if self._room is not None:
            self._room.update()

    async def _run(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._loop.set_exception_handler(self._report)
        self._update()
        while True:
            with contextlib.suppress(asyncio.TimeoutError):
                await asyncio.wait_for(self._woken.wait(), PERIOD_S)
            self._woken.clear()
            self._update()
            self._expire()

    def _report(self, _: asyncio.AbstractEventLoop, context: Mapping[str, Any]) -> None:
        """Say what a browser's message has caused, each kind of error once and in one line."""
        error = context.get("exception")
        kind = type(error).__name__ if error else str(context.get("message", ""))
        if kind not in self._reported and len(self._reported) < MOST_KINDS:
            self._reported.add(kind)
            self._say(f"the page passes over what a browser sent: {kind}")

    def _expire(self) -> None:
        """Forget pages that no browser has connected to; NiceGUI keeps them for a minute."""
        now_s = time.monotonic()
        if now_s - self._expired_s > CONNECT_S / 2.0:
            self._expired_s = now_s
            Client.prune_instances(client_age_threshold=CONNECT_S)
