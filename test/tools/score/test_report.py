"""The report: sound markup, nothing from the network, every run listed, the charts' geometry."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest
from support import browser as browsers

from flea_diag.tools.campaign.campaign import Campaign
from flea_diag.tools.campaign.run_result import RunResult
from flea_diag.tools.score.report import page, to_draw
from flea_diag.tools.score.report_charts import WIDTH, group_steps, strip, symbol_matrix, time_axis
from flea_diag.tools.score.report_tables import report_tables
from flea_diag.tools.score.summary import summarise

VOID = {"meta", "br", "link"}

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
        self.anchors: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        named = dict(attrs)
        self.addresses += [v for k, v in attrs if k in ("src", "href") and v]
        self.anchors |= {named["id"]} if named.get("id") else set()  # type: ignore[arg-type]
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Closes itself."""

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


@pytest.fixture(scope="module")
def made() -> str:
    pytest.importorskip("jinja2", reason="the report needs Jinja2, which is not installed")
    results = [result(f"run {k}", right=k != 1) for k in range(5)]
    results.append(result("<script>alert(1)</script>", failure="no scan in it & more"))
    return page("Title", "today", results, summarise(Campaign(), results), lambda _: TRACE)


def test_the_markup_is_whole_and_asks_for_nothing_from_outside(made: str) -> None:
    parser = Balanced()
    parser.feed(made)
    assert parser.open == []
    assert all(address.startswith("#") for address in parser.addresses)
    assert {address[1:] for address in parser.addresses} <= parser.anchors
    assert not re.search(r"https?://|@import|url\(", made)


def test_it_fits_a_phone(made: str, tmp_path: Path) -> None:
    if browsers.missing():
        pytest.skip(browsers.missing())
    (tmp_path / "report.html").write_text(made, encoding="utf-8")
    with browsers.chromium(390, 844) as phone:
        phone.open((tmp_path / "report.html").as_uri())
        phone.run("document.querySelectorAll('details').forEach(d => { d.open = true; })")
        assert phone.run("document.documentElement.scrollWidth <= innerWidth")
        heights = phone.run("[...document.querySelectorAll('svg.strip')].map(s => s.clientHeight)")
        assert set(heights) == {64}
        assert phone.run("document.querySelectorAll('.estimate').length") > 0


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
    assert injected["title"].endswith("recorded runs with a software fault put in")


def test_only_residuals_near_their_limits_are_drawn(made: str) -> None:
    assert ">parity<" in made
    assert "quiet" not in made


def test_the_estimate_lies_over_its_signal_with_its_band(made: str) -> None:
    signals = made.partition("<h3>Signals")[2]
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
