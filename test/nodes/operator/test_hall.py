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

"""One console for several stands: list, one opened, alarms of all in one journal."""

from __future__ import annotations

import asyncio
from contextlib import ExitStack
from pathlib import Path

import pytest
from support.live import Peer, Process, node
from support.verdicts import FLAG, LAST, NOMINAL, START

from flea_diag.nodes.operator.alarm_journal import AlarmJournal
from flea_diag.nodes.operator.hall import Hall
from flea_diag.wire.records import AmbiguityGroup, Scan

NODE = "console"


def test_a_console_prints_the_verdicts_of_all_stands_it_finds(domain: int, tmp_path: Path) -> None:
    journal = tmp_path / "alarms.sqlite"
    command = node(NODE, "-p", "stands:=['*']", "-p", f"journal:={journal}")
    with ExitStack() as stack:
        process = stack.enter_context(Process(command, domain))
        peers = [stack.enter_context(Peer(domain, name)) for name in ("bay_1", "hall/bay_2")]
        for peer, records in zip(peers, ((NOMINAL,), (FLAG, LAST)), strict=True):
            for record in records:
                peer.bus.publish(record)
        process.wait_for("OK NOMINAL")
        process.wait_for("hall/bay_2  22:13:24.000 ERROR ISOLATED")
    assert [a.detected_ns for a in AlarmJournal(journal, "hall/bay_2").alarms()] == [START]
    assert AlarmJournal(journal, "bay_1").alarms() == ()


def test_the_screen_lists_stands_and_opens_one(domain: int, tmp_path: Path) -> None:
    pytest.importorskip("textual", reason="the screen needs Textual: pip install textual")
    from flea_diag.nodes.operator.console_hall import HallApp

    with Peer(domain, name="screen") as screen, Peer(domain, "bay_2", "source") as source:
        hall = Hall(screen.bus, ("bay_1", "bay_2"), str(tmp_path / "alarms.sqlite"), "Ada")
        assert source.heard(AmbiguityGroup)
        source.bus.publish(LAST)
        screen.until(lambda: hall.desks["bay_2"].state.group is not None)

        async def play() -> None:
            app = HallApp(hall)
            async with app.run_test(size=(140, 50)) as pilot:
                await pilot.pause()
                rows = pilot.app.screen.query_one("#stands")
                assert [option.id for option in rows.options] == ["bay_2", "bay_1"]
                await pilot.press("enter")
                await pilot.pause()
                assert "ISOLATED" in str(pilot.app.screen.query_one("#verdict").render())
                screen.until(lambda: source.bus.subscribers(Scan) == 1)
                await pilot.press("a")
                await pilot.press("escape")
                await pilot.pause()
                assert pilot.app.screen.query("#stands")
                screen.until(lambda: source.bus.subscribers(Scan) == 0)

        asyncio.run(play())
        (alarm,) = hall.desks["bay_2"].state.alarms
        assert alarm.acknowledged_by == "Ada"
        hall.end()
