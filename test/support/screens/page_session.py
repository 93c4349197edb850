"""A page in a real Chromium on a desk in this process: what arrives is up to the test."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from nicegui import Client
from nicegui.testing.general import nicegui_reset_globals

from flea_diag.nodes.operator.alarm_journal import AlarmJournal
from flea_diag.nodes.operator.desk import Desk
from flea_diag.nodes.operator.web import picture_tools
from flea_diag.web.pages.site import Site
from flea_diag.web.server import Server
from flea_diag.wire.records import (
    AmbiguityGroup,
    ChannelInfo,
    ChannelQuality,
    ChannelTable,
    DataQuality,
    Quality,
    Record,
    Residual,
    Scan,
    VibrationLevel,
)
from support.browser import Browser, chromium

TITLE = "flea_diag · bay"
CHANNELS = (("motor_current", "A"), ("motor_speed", "rad/s"), ("load_force", "N"))
RESIDUALS = ("parity_mechanical", "parity_electrical", "motor_current_stuck", "load_position")
LIMITS = (6.0, 5.0, 50.0, 1.0)
EVERY_S = 0.05
VERDICT_EVERY = 10


class PageSession:
    """A stand that lives as long as it is not told to die, and the page that shows it."""

    def __init__(self, desk: Desk, browser: Browser, url: str) -> None:
        self.desk, self.browser, self.url = desk, browser, url
        self.verdict: AmbiguityGroup | None = None
        self.z = (0.0, 4.7e-16, 0.0, 0.05)
        self.lives = threading.Event()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._live, daemon=True)

    def take(self, *records: Record) -> None:
        """Records that arrive now; a verdict is repeated from then on."""
        for record in records:
            if isinstance(record, AmbiguityGroup):
                self.verdict = record
            self.desk.take(record)

    def tell_channels(self, lost: int = 0) -> None:
        """The table of channels, and that all of them are good."""
        now_ns = time.time_ns()
        rows = tuple(ChannelInfo(n, u, -9.0, 9.0, 1.0 / EVERY_S) for n, u in CHANNELS)
        names = ("sensors/slow", *(name for name, _ in CHANNELS))
        counters = {"sensors/slow": (("samples", 9000), ("lost", lost))}
        quality = (ChannelQuality(n, Quality.GOOD, now_ns, "", counters.get(n, ())) for n in names)
        self.take(ChannelTable(now_ns, "bay", rows), DataQuality(now_ns, tuple(quality)))

    def start(self) -> None:
        """Begin to live."""
        self.lives.set()
        self._thread.start()

    def _live(self) -> None:
        count = 0
        while not self._ended.wait(EVERY_S):
            if not self.lives.is_set():
                continue
            now_ns, count = time.time_ns(), count + 1
            swing = tuple(math.sin(count / 10.0 + k) for k in range(len(CHANNELS)))
            self.desk.take(Scan(now_ns, tuple(name for name, _ in CHANNELS), swing))
            self.desk.take(Residual(now_ns, RESIDUALS, (0.0,) * 4, self.z, LIMITS))
            self.desk.take(VibrationLevel(now_ns, ("accelerometer_1_x",), (0.5,), (3.0,)))
            if self.verdict is not None and count % VERDICT_EVERY == 0:
                self.desk.take(replace(self.verdict, seq=count, stamp_ns=now_ns))
            self.desk.tick()

    def close(self) -> None:
        """End."""
        self._ended.set()
        self._thread.join()


@contextmanager
def page_session(folder: Path) -> Iterator[PageSession]:
    """A page open in a browser."""
    desk = Desk(AlarmJournal(folder / "alarms.sqlite"), "Ada")
    # The library expects to be started once in a process; another test may have done so.
    with nicegui_reset_globals(), chromium() as browser:
        Site().serve_stand(desk, picture_tools("flea"), TITLE)
        server = Server(TITLE, "127.0.0.1", 0, token="")
        server.start()
        session = PageSession(desk, browser, f"http://127.0.0.1:{server.port}/")
        try:
            yield session
        finally:
            session.close()
            server.close()
            desk.close()
            Client.page_routes.clear()
