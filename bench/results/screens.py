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

"""Pictures of the pages at every size, in both themes, for people who look for what is ugly.

    .venv/bin/python bench/results/screens.py FOLDER [LANGUAGE]

Stands of this process feed them: one with a fault, and one with 500 alarms within a minute and
names of 200 letters. Needs Chromium, like the tests of the page; none of it is kept.
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("PYTEST_CURRENT_TEST", Path(__file__).name)
# NiceGUI lets several pages follow each other in a process for tests alone.
ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "test"))

from support.browser import Browser, missing
from support.screens.axe import SIZES, THEMES
from support.screens.living_stand import LivingStand
from support.screens.page_session import hall_session, page_session
from support.verdicts import FLAG, LAST, NOMINAL, START

FLOOD, LONG = 500, 200
TO_DO = (
    ("run", "stop"), ("urgency", "now"), ("name", "Jammed screw"),
    ("part", "ball screw, in the housing, between screw and nut"),
    ("procedure", "Stop, and lock the stand. Turn the screw by hand over its stroke; look for "
     "chips, bent recirculation tubes and dents. Do not run it free under load."),
)  # fmt: skip


def jam(stand: LivingStand) -> None:
    """One fault, found and named."""
    stand.tell_channels()
    stand.take(NOMINAL, FLAG, replace(LAST, words="the fault is jam", to_do=TO_DO))
    stand.desk.mark("load changed", START)
    stand.z = (9.0, 1.0, 51.0, 0.9)


def flood(stand: LivingStand) -> None:
    """More alarms than anybody can read, of a fault with a long name and without a procedure."""
    stand.tell_channels()
    member = replace(LAST.members[0], fault="n" * LONG)
    for k in range(FLOOD):
        at_ns = START + k * 60 * 10**9 // FLOOD
        words = f"the fault is {member.fault}"
        stand.take(replace(LAST, detected_stamp_ns=at_ns, stamp_ns=at_ns, members=(member,),
                           words=words))  # fmt: skip


def shots(browser: Browser, url: str, ready: str, name: str, folder: Path) -> None:
    """One page, at all sizes and in both themes."""
    for theme in THEMES:
        browser.theme(theme)
        for width, height in SIZES:
            browser.size(width, height)
            browser.open(url)
            browser.until(f"innerWidth === {width} && {ready}")
            browser.run("new Promise((done) => setTimeout(() => done(true), 1200))")
            browser.shot(folder / f"{name}_{width}_{theme}.png")


def stand_shots(folder: Path, language: str, kind: Callable[[LivingStand], None]) -> None:
    """The page of one stand, and its report."""
    live = "!!document.querySelector('.chip.live')"
    with tempfile.TemporaryDirectory() as kept, page_session(Path(kept), language) as session:
        kind(session)
        session.start()
        shots(session.browser, session.url, live, kind.__name__, folder)
        heading = "!!document.querySelector('h1')"
        shots(session.browser, f"{session.url}report", heading, f"{kind.__name__}_report", folder)


def hall_shots(folder: Path, language: str) -> None:
    """The list of several stands."""
    names = ("bay_1", "hall/bay_2", "bay_3", "bay_4")
    with tempfile.TemporaryDirectory() as kept, hall_session(Path(kept), names, language) as hall:
        jam(hall.stands["hall/bay_2"])
        hall.stands["bay_1"].take(NOMINAL)
        flood(hall.stands["bay_3"])
        for name in names[:3]:
            hall.stands[name].start()
        shots(hall.browser, hall.url, "!!document.querySelector('a.stand')", "stands", folder)


def main() -> int:
    """Make the pictures; the exit status."""
    if missing() or len(sys.argv) < 2:
        print(missing() or __doc__, file=sys.stderr)
        return 2
    folder, language = Path(sys.argv[1]), (*sys.argv[2:], "en")[0]
    folder.mkdir(parents=True, exist_ok=True)
    for kind in (jam, flood):
        stand_shots(folder, language, kind)
    hall_shots(folder, language)
    print(folder)
    return 0


if __name__ == "__main__":
    sys.exit(main())
