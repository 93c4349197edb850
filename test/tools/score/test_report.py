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

"""The report: sound markup, nothing from the network, every run listed, the charts' geometry."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest
from support import browser as browsers

from flea_diag.tools.campaign.campaign import Campaign
from flea_diag.tools.campaign.run_result import RunResult
from flea_diag.tools.score.report import drawing, drawing_of, neighbours, page, to_draw
from flea_diag.tools.score.report_charts import WIDTH, group_steps, strip, symbol_matrix, time_axis
from flea_diag.tools.score.report_tables import report_tables
from flea_diag.tools.score.summary import summarise

VOID = {"meta", "br", "link", "wbr"}

TRACE: dict[str, Any] = {
    "duration_s": 20.0,
    "traces": {
        "motor_current": {"stretch_s": 10.0, "unit": "A", "low": [0.0, 1.0], "high": [0.5, 2.0]},
        "motor_current/band": {"stretch_s": 10.0, "unit": "", "low": [0.1] * 2, "high": [1.0] * 2},
        "parity/limit": {"stretch_s": 10.0, "unit": "", "low": [0.0, 0.0], "high": [0.1, 9.0]},
        "quiet/limit": {"stretch_s": 10.0, "unit": "", "low": [-0.4, 0.0], "high": [0.1, 0.2]},
    },
    "symbols": [[10.0, [["parity", "+", "?"]]], [12.0, [["parity", "+", "0"]]]],
    "groups": [
        {
            "at_s": 10.0,
            "outcome": "DETECTED",
            "episode": 1,
            "members": [["jam", 0.5], ["spall", 0.5]],
            "dropped": {},
            "words": "",
            "features": [[], 13],
        },
        {
            "at_s": 15.0,
            "outcome": "ISOLATED",
            "episode": 1,
            "members": [["jam", 1.0]],
            "dropped": {"spall": "sign"},
            "words": "",
            "features": [["crest"], 13],
        },
    ],
    "features": [],
    "truth": [["jam", 8.0]],
}


def result(name: str, right: bool = True, **given: Any) -> RunResult:
    said = {
        "kind": "simulated",
        "configuration": "hybrid",
        "row": "Jam",
        "truth": "jam",
        "onset_s": 8.0,
        "expected": ("jam",),
        "outcome": "ISOLATED",
        "group": ("jam",) if right else ("spall",),
        "detection_time_s": 2.0,
        "alarms_s": (10.0,),
    }
    return RunResult(id=f"drawn/{name}", **{**said, **given})


class Balanced(HTMLParser):
    """Every tag that is opened is closed, in order; addresses that are named are kept."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.addresses: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.addresses += [v for k, v in attrs if k in ("src", "href") and v]
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Closes itself."""

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


LONG = "real/BatchProfile_sine14_2010_09_10_15_07_55_Position_t+10.37_o+0.00_s+0.00_Low"


@pytest.fixture(scope="module")
def runs() -> list[RunResult]:
    pytest.importorskip("jinja2", reason="the report needs Jinja2, which is not installed")
    made = [result(f"run {k}", right=k != 1, detail=f"runs/run {k}.json") for k in range(5)]
    return [*made, result("<script>alert(1)</script>", failure="no scan in it & more")]


@pytest.fixture(scope="module")
def made(runs: list[RunResult]) -> str:
    return page("Title", "today", runs, summarise(Campaign(), runs), {r.key for r in runs[:5]})


@pytest.fixture(scope="module")
def drawn(runs: list[RunResult]) -> str:
    return drawing(runs[1], TRACE, "", drawing_of(runs[0]))


def addresses(text: str) -> list[str]:
    """Addresses in sound markup that asks for nothing from elsewhere."""
    parser = Balanced()
    parser.feed(text)
    assert parser.open == []
    assert not re.search(r"https?://|@import|url\(", text)
    return parser.addresses


def test_the_markup_is_whole_and_leads_to_the_drawings_alone(made: str, drawn: str) -> None:
    assert addresses(made) == [f"runs/run%20{k}.html" for k in range(5)]
    assert addresses(drawn) == ["../report.html", "../runs/run%200.html"]


def test_each_drawing_leads_to_its_neighbours(runs: list[RunResult]) -> None:
    found = [(before, after) for _, before, after in neighbours(runs[:3])]
    first, second, third = (drawing_of(each) for each in runs[:3])
    assert found == [("", second), (first, third), (second, "")]


def crowded() -> tuple[list[RunResult], str]:
    """Runs with names and groups as long as they come, of eight diagnosers, and their report."""
    group = tuple(f"actuator_position_fault_{k}" for k in range(17))
    results = [
        result("x", group=group, outcome="INDISTINGUISHABLE", configuration=f"diagnoser_{k % 8}",
               truth="actuator_position_scaling", detail="runs/x.json", cpu_s=12.34,
               isolation_time_s=11.5, failure="no scan in it, " * 30 if k == 9 else "")
        for k in range(40)
    ]  # fmt: skip
    results = [replace(each, id=f"{LONG}_{k}", fold="A") for k, each in enumerate(results)]
    text = page("Crowded", "today", results, summarise(Campaign(), results),
                {each.key for each in results})  # fmt: skip
    return results, text


@pytest.fixture(scope="module")
def browser() -> Iterator[browsers.Browser]:
    if browsers.missing():
        pytest.skip(browsers.missing())
    with browsers.chromium() as found:
        yield found


OVERFLOW = "document.documentElement.scrollWidth - innerWidth"
TABLE = "document.querySelector('table.sortable')"


@pytest.mark.parametrize(("width", "highest"), [(1300, 100), (820, 170)])
def test_the_table_of_runs_fits_its_window_with_rows_of_a_few_lines(
    width: int, highest: int, tmp_path: Path, browser: browsers.Browser
) -> None:
    (tmp_path / "report.html").write_text(crowded()[1], encoding="utf-8")
    browser.size(width, 1000)
    browser.open((tmp_path / "report.html").as_uri())
    assert browser.run(OVERFLOW) <= 0
    assert browser.run(f"{TABLE}.scrollWidth - {TABLE}.parentElement.clientWidth") <= 0
    assert browser.run(f"Math.max(...[...{TABLE}.tBodies[0].rows].map(r => r.offsetHeight))") <= (
        highest
    )
    assert browser.run(f"{TABLE}.tBodies[0].rows[0].cells[0].offsetWidth") >= 160


def test_nothing_is_cut_on_paper(tmp_path: Path, browser: browsers.Browser) -> None:
    (tmp_path / "report.html").write_text(crowded()[1], encoding="utf-8")
    browser.open((tmp_path / "report.html").as_uri())
    browser.media("print")
    browser.size(703, 1000)  # 210 mm less two margins of 12 mm, at 96 dots an inch
    assert browser.run(f"{TABLE}.getBoundingClientRect().right - innerWidth") <= 0
    browser.media("")


def test_the_report_grows_by_less_than_a_kilobyte_a_run() -> None:
    pytest.importorskip("jinja2", reason="the report needs Jinja2, which is not installed")
    results, text = crowded()
    assert len(text.encode()) < 40_000 + 1000 * len(results)


def test_a_drawing_fits_a_phone(
    drawn: str, made: str, tmp_path: Path, browser: browsers.Browser
) -> None:
    for name, text in (("report.html", made), ("drawing.html", drawn)):
        (tmp_path / name).write_text(text, encoding="utf-8")
        browser.size(390, 844)
        browser.open((tmp_path / name).as_uri())
        browser.run("document.querySelectorAll('details').forEach(d => { d.open = true; })")
        assert browser.run(OVERFLOW) <= 0
    heights = browser.run("[...document.querySelectorAll('svg.strip')].map(s => s.clientHeight)")
    assert set(heights) == {64}
    assert browser.run("document.querySelectorAll('.estimate').length") > 0


def test_a_heading_sorts_the_runs(made: str, tmp_path: Path, browser: browsers.Browser) -> None:
    (tmp_path / "report.html").write_text(made, encoding="utf-8")
    browser.size(1300, 1000)
    browser.open((tmp_path / "report.html").as_uri())
    judged = f"[...{TABLE}.tBodies[0].rows].map(r => r.cells[2].textContent)"
    wrong, right = "✗ wrong", "✓ right"
    assert browser.run(judged) == [right, wrong, right, right, right, wrong]
    browser.run(f"{TABLE}.tHead.rows[0].cells[2].click()")
    once = browser.run(judged)
    browser.run(f"{TABLE}.tHead.rows[0].cells[2].click()")
    assert sorted([once, browser.run(judged)]) == sorted(
        [[right] * 4 + [wrong] * 2, [wrong] * 2 + [right] * 4]
    )


def test_names_from_files_are_shown_not_run(made: str) -> None:
    assert "<script>alert" not in made
    assert "&lt;script&gt;alert(1)&lt;/script&gt;" in made


def test_every_run_is_a_line_and_the_table_stands_beside_the_paper(made: str) -> None:
    body = made.partition('class="sortable"')[2].partition("</table>")[0]
    assert body.count("<tr>") == 1 + 6
    # 4 of 6: its Wilson interval from the closed form, z = 1.959964.
    assert "4 of 6" in made
    assert "66.7 %" in made
    assert "30.0 to 90.3" in made
    assert '<td class="n faint">66.7 %</td>' in made  # the paper's 10 of 15


def test_wrong_runs_are_drawn_first_then_of_each_row_in_turn() -> None:
    results = [result(f"{k}", right=k != 4) for k in range(5)] + [result("f", failure="broken")]
    results += [result(f"s{k}", row="Spall") for k in range(2)]
    order = ["4", "0", "s0", "1", "s1", "2", "3"]
    assert [r.id.removeprefix("drawn/") for r in to_draw(results)] == order
    assert [r.id.removeprefix("drawn/") for r in to_draw(results, 3)] == order[:3]


def test_two_diagnosers_of_the_same_runs_stand_side_by_side() -> None:
    results = [result("a"), result("a", configuration="paper", group=("jam", "spall"))]
    results.append(result("b", kind="injected"))
    simulated, injected = report_tables(summarise(Campaign(), results))
    assert simulated["configurations"] == ["hybrid", "paper"]
    (jam, whole) = simulated["rows"]
    assert [cell["right"] for cell in jam["cells"]] == ["1", "0"]
    assert [cell["count"] for cell in whole["cells"]] == ["1", "1"]
    assert injected["configurations"] == ["hybrid"]
    assert injected["title"].endswith("recorded runs with an injected software fault")


def test_only_residuals_near_their_limits_are_drawn(drawn: str) -> None:
    assert ">parity<" in drawn
    assert "quiet" not in drawn


def test_the_estimate_lies_over_its_signal_with_its_band(drawn: str) -> None:
    signals = drawn.partition("<h3>Signals")[2]
    assert "bands of two standard deviations" in signals.partition("</h3>")[0]
    assert signals.count('class="estimate"') == signals.count('class="middle"') > 0


def test_an_estimate_is_drawn_on_the_scale_of_its_signal() -> None:
    signal = {"stretch_s": 1.0, "unit": "A", "low": [0.0, 0.0], "high": [10.0, 10.0]}
    near = {"stretch_s": 1.0, "unit": "", "low": [4.0, 4.0], "high": [6.0, 6.0]}
    (middle,) = re.findall(r'class="middle" d="M([^"]+)"', strip(signal, 2.0, estimate=near))
    assert {float(point.split(",")[1]) for point in middle.split("L")} == {32.0}
    # One that runs away widens the chart by 30 % of the signal and no further: 10 of 13 are left.
    far = {**near, "low": [900.0, 900.0], "high": [901.0, 901.0]}
    (band,) = re.findall(r'class="band" d="M([^"]+)Z"', strip(signal, 2.0, estimate=far))
    heights = [float(point.split(",")[1]) for point in band.split("L")]
    assert max(heights) - min(heights) == pytest.approx(56.0 * 10.0 / 13.0 + 1.2, abs=0.11)


def test_the_axis_has_round_seconds_where_they_are() -> None:
    ticks = re.findall(r'left:([\d.]+)%">([\d.]+) s', time_axis(20.0))
    assert [at for _, at in ticks] == ["0", "5", "10", "15", "20"]
    assert float(ticks[-1][0]) == pytest.approx(100.0 * (WIDTH - 8.0) / WIDTH, abs=0.01)
    assert len(re.findall("<span", time_axis(36_000.0))) <= 9


def coordinates(svg: str, kind: str) -> list[tuple[float, float]]:
    pattern = rf'<line class="{kind}" x1="([\d.]+)" x2="([\d.]+)"'
    return [(float(a), float(b)) for a, b in re.findall(pattern, svg)]


def test_a_band_leaves_holes_and_is_clipped_at_the_drawn_range() -> None:
    trace = {"stretch_s": 1.0, "unit": "", "low": [0.0, None, 0.0], "high": [1.0, None, 50.0]}
    drawn = strip(trace, 3.0, limit=True)
    assert drawn.count("<path") == 2
    heights = [float(y) for y in re.findall(r",(-?[\d.]+)", drawn)]
    assert all(0.0 <= y <= 64.0 for y in heights)
    assert len(coordinates(drawn, "limit")) == 2


def test_the_group_is_drawn_for_as_long_as_each_fault_was_in_it() -> None:
    drawn = group_steps(TRACE["groups"], 20.0)
    ((kept_0, kept_1),), ((out_0, out_1),) = (
        coordinates(drawn, kind) for kind in ("member", "dropped")
    )
    assert kept_0 == out_0
    assert kept_1 == pytest.approx(WIDTH - 8.0)
    assert (out_1 - out_0) / (kept_1 - kept_0) == pytest.approx(0.5, abs=0.01)
    assert drawn.index("jam") < drawn.index("spall")


def test_symbols_last_until_the_next_ones() -> None:
    drawn = symbol_matrix(TRACE["symbols"], 20.0)
    widths = [float(w) for w in re.findall(r'width="([\d.]+)"', drawn)]
    assert widths[1] / widths[0] == pytest.approx(4.0, abs=0.02)
    assert drawn.count('class="plus"') == 2
    assert symbol_matrix([], 20.0) == group_steps([], 20.0) == ""
