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

"""The list of alarms on the console: filter, priority, first out; and in German."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from support.verdicts import FLAG, LAST, NOMINAL, START

pytest.importorskip("textual", reason="the screen needs Textual: pip install textual")

from textual.widgets import OptionList, Static

from flea_diag.configuration.languages import catalogue
from flea_diag.nodes.operator.alarm_journal import AlarmJournal
from flea_diag.nodes.operator.console_app import ConsoleApp
from flea_diag.nodes.operator.desk import Desk
from flea_diag.operator.shift.alarm_filter import FILTERS
from flea_diag.operator.words import speaking

URGENT = replace(LAST, to_do=(("run", "stop"), ("urgency", "now")))


@pytest.fixture
def desk(tmp_path: Path) -> Iterator[Desk]:
    made = Desk(AlarmJournal(tmp_path / "alarms.sqlite"), "Ada")
    for record in (NOMINAL, FLAG, URGENT, replace(LAST, detected_stamp_ns=START + 7)):
        made.take(record)
    made.acknowledge(made.state.alarms[-1].key)
    made.take(replace(URGENT, detected_stamp_ns=START + 9))
    yield made
    made.close()


def listed(desk: Desk, presses: int) -> tuple[str, str, str]:
    """Title and entries of the list after so many presses of f, and the key bar."""
    found: list[str] = []

    async def play() -> None:
        app = ConsoleApp(desk)
        async with app.run_test(size=(160, 60)) as pilot:
            await pilot.press(*"f" * presses)
            await pilot.pause()
            screen = app.screen_stack[0]
            rows = screen.query_one("#episodes", OptionList)
            entries = [rows.get_option_at_index(k) for k in range(rows.option_count)]
            found.append(str(screen.query_one("#episodes-title", Static).content))
            found.append("\n".join(str(entry.prompt) for entry in entries))
            keys = [row[1] for row in screen.active_bindings.values()]
            found.append(" ".join(key.description for key in keys if key.show))

    asyncio.run(play())
    return found[0], found[1], found[2]


def test_the_list_names_priority_and_first_out(desk: Desk) -> None:
    title, entries, _ = listed(desk, 0)
    first = entries.splitlines()[-1]
    assert title.startswith("EPISODES  3 kept, 2 not acknowledged")
    assert first.startswith("NEW      priority 1 FIRST OUT 22:13:20")
    assert entries.count("FIRST OUT") == 1
    assert "acknowl. 22:13:20" in entries


def test_a_key_goes_through_the_filters_and_comes_back(desk: Desk) -> None:
    counts = [len(listed(desk, presses)[1].splitlines()) for presses in range(len(FILTERS) + 1)]
    assert dict(zip(FILTERS, counts, strict=False)) == {
        "every": 3, "standing": 2, "active": 1, "silenced": 0, "now": 2, "soon": 0, "planned": 0,
    }  # fmt: skip
    assert counts[-1] == counts[0]
    assert "shown: not acknowledged, 2" in listed(desk, 1)[0]


def test_the_console_speaks_german(desk: Desk) -> None:
    with speaking(*catalogue("de")):
        title, entries, keys = listed(desk, 1)
    assert title.startswith("EPISODEN  3 behalten, 2 nicht quittiert")
    assert "NEU      Priorität 1 ERSTER" in entries
    assert "Quittieren" in keys
    assert "Beenden" in keys
    assert "Quit " not in f"{keys} "
