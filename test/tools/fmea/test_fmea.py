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

"""``flea fmea`` as its users call it."""

from __future__ import annotations

import csv
import json
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest

from flea_diag.errors import ConfigurationError
from flea_diag.tools.fmea.failure import (
    EARLY,
    GROUPED,
    ISOLATED,
    MISNAMED,
    MISSED,
    NEAREST,
    UNEXPLAINED,
    AnalysedFailure,
    Failure,
    became,
)
from flea_diag.tools.fmea.motion_effect import MotionEffect
from flea_diag.tools.fmea.ratings import load_ratings
from flea_diag.tools.fmea.table import as_csv, as_html
from flea_diag.tools.main import main

RATED = "jam: {severity: 8, occurrence: 2}\nsupply_noise: {severity: 4}\nspall: {severity: 2}\n"
"""Of a fault, too, that is not asked for."""
JAM = Failure("jam_1", "jam", "jam", "screw", 1.0)
LEAK = Failure("leak_1", "leak", "leak", "leads", 1.0, "", ("winding_short", "winding_open"))


class Page(HTMLParser):
    """Rows of cells, links, and whatever a browser would load or run from elsewhere."""

    def __init__(self) -> None:
        super().__init__()
        self.rows: list[list[str]] = []
        self.links: list[str] = []
        self.foreign: list[str] = []
        self._open = False

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._open = tag in ("td", "th") or (self._open and tag not in ("tr", "table"))
        if tag == "tr":
            self.rows.append([])
        elif tag in ("td", "th"):
            self.rows[-1].append("")
        self.links += [value or "" for name, value in attrs if name == "href"]
        self.foreign += [value or "" for name, value in attrs if name == "src"]

    def handle_endtag(self, tag: str) -> None:
        self._open = self._open and tag not in ("td", "th")

    def handle_data(self, data: str) -> None:
        if self._open:
            self.rows[-1][-1] += data


def parsed(text: str) -> Page:
    page = Page()
    page.feed(text)
    return page


@pytest.fixture(scope="module")
def analysed(compiled: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three faults of the shipped stand at their default size, rated."""
    folder = tmp_path_factory.mktemp("fmea")
    (folder / "ratings.yaml").write_text(RATED)
    named = [x for f in ("jam", "supply_noise", "motor_current_bias") for x in ("--fault", f)]
    given = ["--sizes", "1", "-j", "1", "--ratings", str(folder / "ratings.yaml")]
    command = ["fmea", "-o", str(folder / "out"), *named, *given]
    assert main([*command, "--json", str(folder / "lines.json")]) == 0
    return folder


def lines(folder: Path) -> dict[str, dict[str, Any]]:
    content = json.loads((folder / "lines.json").read_text())
    return {row["fault"]: row for row in content["lines"]}


def test_a_line_says_what_a_fault_does_and_what_became_of_it(analysed: Path) -> None:
    found = lines(analysed)
    nominal = json.loads((analysed / "lines.json").read_text())["nominal"]
    jam, noise, bias = (found[f] for f in ("jam", "supply_noise", "motor_current_bias"))
    assert jam["current_rms_a"] > 1.3 * nominal["current_rms_a"]
    assert jam["tracking_rms"] > 1.05 * nominal["tracking_rms"]
    assert jam["became"] in (ISOLATED, GROUPED)
    assert jam["detected_by"].startswith("parity_mechanical")
    assert jam["what_to_do"].startswith("now; stop; ")
    # A bias of the reading is one of the loop's as well: by default it is in the DAQ alone.
    assert bias["tracking_rms"] == pytest.approx(nominal["tracking_rms"], rel=1e-6)
    assert 0.0 < bias["delay_s"] < 5.0
    assert (noise["became"], noise["detection"]) == (MISSED, 10)
    assert "a probe of the supply" in noise["remark"]


def test_ratings_come_in_and_the_risk_is_their_product(analysed: Path) -> None:
    found = lines(analysed)
    assert found["jam"]["risk_priority_number"] == 8 * 2 * found["jam"]["detection"]
    assert found["supply_noise"]["severity"] == 4
    assert found["supply_noise"]["risk_priority_number"] is None  # no occurrence
    assert next(iter(found)) == "jam"  # the only one with a risk comes first


def test_page_and_table_hold_the_lines_and_lead_to_the_bags(analysed: Path) -> None:
    page = parsed((analysed / "out" / "fmea.html").read_text())
    assert page.foreign == []
    assert [len(row) for row in page.rows] == [11] * 4
    assert len(page.links) == 3
    for link in page.links:
        assert (analysed / "out" / link / "metadata.yaml").is_file()
    with (analysed / "out" / "fmea.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["fault"] for row in rows] == list(lines(analysed))
    assert [row["bag"] for row in rows] == page.links


def test_a_bag_is_diagnosed_again_as_its_line_says(
    analysed: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    jam = lines(analysed)["jam"]
    assert main(["replay", str(analysed / "out" / jam["bag"]), "--json"]) == 0
    again = json.loads(capsys.readouterr().out)
    again = again[0] if isinstance(again, list) else again
    assert again["episodes"][-1]["ambiguity_group"] == jam["group"]
    assert again["episodes"][-1]["outcome"] == jam["outcome"]


def test_faults_of_sensors_are_injected_into_healthy_recordings(
    compiled: None, tmp_path: Path
) -> None:
    bag, out = tmp_path / "healthy", tmp_path / "out"
    simulated = ["simulate", "nominal", "-o", str(bag), "--seed", "8", "--duration", "24"]
    assert main([*simulated, "--no-vibration"]) == 0
    named = ["--fault", "motor_current_dead", "--fault", "winding_short"]
    given = ["--bags", str(bag), "-j", "1", "--json", str(tmp_path / "lines.json")]
    assert main(["fmea", "-o", str(out), *named, *given]) == 0
    found = lines(tmp_path)
    dead, short = found["motor_current_dead"], found["winding_short"]
    assert dead["became"] == ISOLATED
    assert dead["size"] == 0.0
    assert "current_rms_a" not in dead  # the motion is that of the recording
    assert (short["became"], short["bag"]) == ("not run", "")
    assert "cannot be injected" in short["remark"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--fault", "jamm"], "did you mean jam?"),
        (["cranfield"], "no machine is named cranfield"),
        (["ema", "--table1"], "Table 1 is that of flea"),
        (["-j", "0"], "must be from 1"),
        (["--ratings", "nowhere.yaml"], "nowhere.yaml"),
    ],
)
def test_what_cannot_be_analysed_is_refused_in_a_line(
    arguments: list[str], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["fmea", *arguments, "-o", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_a_folder_of_others_is_not_deleted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "kept.txt").write_text("kept")
    assert main(["fmea", "-o", str(tmp_path), "--fault", "jam"]) == 2
    assert main(["fmea", "-o", str(tmp_path), "--fault", "jam", "--force"]) == 2
    assert "holds no analysis" in capsys.readouterr().err
    assert (tmp_path / "kept.txt").read_text() == "kept"


@pytest.mark.parametrize(
    ("detected", "alarms", "outcome", "group", "expected"),
    [
        (True, True, "ISOLATED", ("jam",), ISOLATED),
        (True, True, "AMBIGUOUS", ("spall", "jam"), GROUPED),
        (True, True, "ISOLATED", ("spall",), MISNAMED),
        (True, True, "UNEXPLAINED", ("jam",), UNEXPLAINED),
        (True, True, "AMBIGUOUS", ("jam", *"abcdef"), UNEXPLAINED),
        (False, True, "ISOLATED", ("jam",), EARLY),
        (False, False, "NOMINAL", (), MISSED),
    ],
)
def test_what_became_of_a_failure(
    detected: bool, alarms: bool, outcome: str, group: tuple[str, ...], expected: str
) -> None:
    assert became(JAM, detected, alarms, outcome, group) == expected


def test_a_failure_without_a_row_is_named_as_the_nearest_at_best() -> None:
    assert became(LEAK, True, True, "ISOLATED", ("winding_short",)) == NEAREST
    assert became(LEAK, True, True, "ISOLATED", ("jam",)) == MISNAMED
    assert became(LEAK, True, True, "AMBIGUOUS", ("jam", "winding_short")) == MISNAMED


def test_ratings_are_read_from_both_kinds_of_file(tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_text("fault,severity,occurrence\njam,8,\n")
    (tmp_path / "r.yaml").write_text("jam: {severity: 8}\n")
    assert load_ratings(tmp_path / "r.csv", ["jam"]) == load_ratings(tmp_path / "r.yaml", ["jam"])


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("r.yaml", "jam: {severity: 11}", "severity"),
        ("r.yaml", "jam: {severity: x}", "severity"),
        ("r.yaml", "jan: {severity: 1}", "did you mean jam?"),
        ("r.yaml", "jam: [1", "neither YAML"),
        ("r.csv", "fault,severity\njam,1\n", "the columns must be"),
        ("r.csv", "fault,severity,occurrence\njam,often,1\n", "severity"),
    ],
)
def test_wrong_ratings_are_refused(tmp_path: Path, name: str, text: str, words: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(ConfigurationError, match=words.replace("?", "[?]")):
        load_ratings(tmp_path / name, ["jam"])


def test_text_of_others_stays_text() -> None:
    evil = Failure("x", "=cmd()", "<script>alert(1)</script>", "<b>screw", 1.0, "m&m")
    effect = MotionEffect(1e-3, 2e-3, 1.0, 25.0)
    line = AnalysedFailure(evil, MISSED, effect, bag="bags/a b'\"<x>")
    page = as_html("<t>", "now", [line], effect, "m")
    assert "<script>alert" not in page
    assert "<b>screw" not in page
    assert "1.00 mm" in page
    assert parsed(page).links == ["bags/a%20b%27%22%3Cx%3E"]
    assert "'=cmd()" in as_csv([line])
