"""All open pages of one stand, and the task that updates them.

One task draws for all browsers, ten times a second and at once after a detection. Each browser is
sent the changes, and the rows of numbers that it does not have yet.
"""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import Callable, Mapping
from typing import Any

from nicegui import Client, app, ui

from flea_diag.web.page import OperatorNode, Page
from flea_diag.web.strips import StripCharts
from flea_diag.web.view import View

PERIOD_S = 0.1
CONNECT_S = 15.0
"""Time within which a browser that has loaded the page must connect, or reload it."""
MOST_KINDS = 10
"""Kinds of error that are reported."""
MOST_MARKS = 8
"""Largest number of events of a kind in strip charts."""


class Site:
    """All open pages of one stand, and the task that updates them."""

    def __init__(
        self,
        desk: OperatorNode,
        view: View,
        strips: StripCharts,
        title: str,
        say: Callable[[str], None] = lambda _: None,
    ) -> None:
        self.desk, self.title = desk, title
        self._view, self._strips = view, strips
        self._pages: dict[str, Page] = {}
        self._say = say
        self._reported: set[str] = set()
        self._woken = asyncio.Event()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._expired_s = 0.0
        ui.page("/", title=title)(self._open)
        app.on_startup(self._run)
        app.on_delete(lambda client: self._pages.pop(client.id, None))

    def wake(self) -> None:
        """Draw now; callable from any thread."""
        if self._loop is not None:
            self._loop.call_soon_threadsafe(self._woken.set)

    def _open(self, client: Client) -> None:
        page = self._pages[client.id] = Page(self.desk, self.title, self.wake, client)
        page.fill(self._view)

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

    def _update(self) -> None:
        state = self.desk.state
        self._view.update(state, self.desk.now_ns())
        marks = (
            *((alarm.detected_ns, "detected") for alarm in state.alarms[-MOST_MARKS:]),
            *((mark.stamp_ns, "mark") for mark in state.marks[-MOST_MARKS:]),
        )
        for page in tuple(self._pages.values()):
            if page.client.has_socket_connection:
                with page.client:
                    page.show(self._view, self._strips, marks)
