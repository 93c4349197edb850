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

"""Pages in a real Chromium on desks in this process: what arrives is up to the test."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from nicegui import Client
from nicegui.testing.general import nicegui_reset_globals

from flea_diag.configuration.languages import catalogue
from flea_diag.nodes.operator.alarm_journal import AlarmJournal
from flea_diag.nodes.operator.desk import Desk
from flea_diag.nodes.operator.web import picture_tools
from flea_diag.operator.words import speaking
from flea_diag.web.pages.site import Site
from flea_diag.web.server import Server
from support.browser import Browser, chromium
from support.screens.living_stand import LivingStand

TITLE = "flea_diag · bay"


class PageSession(LivingStand):
    """A stand, and the page that shows it."""

    def __init__(self, desk: Desk, browser: Browser, url: str) -> None:
        super().__init__(desk)
        self.browser, self.url = browser, url


class HallSession:
    """Stands, and the page that lists them."""

    def __init__(self, stands: dict[str, LivingStand], browser: Browser, url: str) -> None:
        self.stands, self.browser, self.url = stands, browser, url


class Stands:
    """The desks behind the list; their streams come whether a stand is open or not."""

    def __init__(self, desks: dict[str, Desk]) -> None:
        self.desks = desks

    @staticmethod
    def now_ns() -> int:
        """Arrival clock."""
        return Desk.now_ns()

    def open(self, name: str) -> Desk:
        """The desk of a stand."""
        return self.desks[name]

    def close(self, name: str) -> None:
        """Nothing is to be left."""


@contextmanager
def served(serve: Callable[[Site], None], language: str) -> Iterator[tuple[Browser, str]]:
    """A browser, and the address of what is served."""
    # The library expects to be started once in a process; another test may have done so.
    with nicegui_reset_globals(), chromium() as browser, speaking(*catalogue(language)):
        serve(Site())
        server = Server(TITLE, "127.0.0.1", 0, token="")
        server.start()
        try:
            yield browser, f"http://127.0.0.1:{server.port}/"
        finally:
            server.close()
            Client.page_routes.clear()


@contextmanager
def page_session(folder: Path, language: str = "en") -> Iterator[PageSession]:
    """The page of a stand in a browser."""
    desk = Desk(AlarmJournal(folder / "alarms.sqlite"), "Ada")
    tools = picture_tools("flea")
    with served(lambda site: site.serve_stand(desk, tools, TITLE), language) as (browser, url):
        session = PageSession(desk, browser, url)
        try:
            yield session
        finally:
            session.close()
            desk.close()


@contextmanager
def hall_session(folder: Path, names: Sequence[str], language: str = "en") -> Iterator[HallSession]:
    """The list of several stands in a browser."""
    desks = {n: Desk(AlarmJournal(folder / "alarms.sqlite", n), "Ada") for n in names}
    tools, stands = picture_tools("flea"), Stands(desks)
    with served(lambda site: site.serve_hall(stands, lambda _: tools, TITLE), language) as opened:
        session = HallSession({n: LivingStand(desk) for n, desk in desks.items()}, *opened)
        try:
            yield session
        finally:
            for stand in session.stands.values():
                stand.close()
                stand.desk.close()
