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

"""The address of the report of a shift: of one stand, or of all."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Annotated
from urllib.parse import quote

from fastapi import Query
from fastapi.responses import HTMLResponse
from nicegui import app, ui

from flea_diag.operator.shift.shift_report import HOURS, States, of_hours, shift_report
from flea_diag.operator.words import tr
from flea_diag.web.markup import tag

REPORT_PATH = "/report"
MOST_HOURS = 24.0 * 366.0

Hours = Annotated[float | None, Query(gt=0.0, le=MOST_HOURS)]


def address(stand: str = "", hours: int | None = None) -> str:
    """Address of a report; without hours of all that the screens keep."""
    asked = [f"stand={quote(stand)}"] if stand else []
    asked += [f"hours={hours}"] if hours else []
    return REPORT_PATH + ("?" + "&".join(asked) if asked else "")


def report_link(stand: str = "") -> None:
    """Add a link to the report of a stand, or of all, which opens beside the page."""
    link = tag("a", tr("Report"), href=address(stand), target="_blank", class_="button")
    ui.html(str(link), sanitize=False)


def serve_report(
    states: Callable[[], States], title: str, facts: Sequence[tuple[str, str]] = ()
) -> None:
    """Serve the report of these stands, and of each of them alone."""

    def report(hours: Hours = None, stand: str = "") -> HTMLResponse:
        found = states()
        if stand and stand not in found:
            return HTMLResponse(tr("There is no such stand."), 404)
        now_ns = time.time_ns()
        shown = {name: state for name, state in found.items() if stand in ("", name)}
        if hours is not None:
            shown = {name: of_hours(state, hours, now_ns) for name, state in shown.items()}
        page = shift_report(shown, stand or title, now_ns, facts, _shifts(stand))
        return HTMLResponse(page)

    app.add_api_route(REPORT_PATH, report)


def _shifts(stand: str) -> tuple[tuple[str, str], ...]:
    shifts = ((address(stand, hours), tr("last {hours} h", hours=hours)) for hours in HOURS)
    return (*shifts, (address(stand), tr("all that is kept")))
