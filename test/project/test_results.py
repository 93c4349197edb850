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

"""The figures of the documents: made from the kept results, none of them typed."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from support.places import ROOT

KEPT = ROOT / "docs" / "results" / "kept"
TOOLS = ROOT / "bench" / "results"


def command(name: str, *arguments: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, str(TOOLS / f"{name}.py"), *map(str, arguments)],
        capture_output=True,
        text=True,
        cwd=ROOT,
        check=False,
    )


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """A source tree of its own, with a README that has the markers."""
    shutil.copytree(KEPT, tmp_path / "docs" / "results" / "kept")
    (tmp_path / "README.md").write_text("before\n<!-- results -->\n<!-- /results -->\nafter\n")
    return tmp_path


def page(tree: Path, name: str) -> str:
    return (tree / "docs" / "results" / f"{name}.md").read_text(encoding="utf-8")


def changed(tree: Path, name: str, **values: object) -> None:
    """The first row of a kept result with other values."""
    path = tree / "docs" / "results" / "kept" / f"{name}.json"
    content = json.loads(path.read_text(encoding="utf-8"))
    content["rows"][0].update(values)
    path.write_text(json.dumps(content), encoding="utf-8")


def test_the_pages_are_what_the_kept_results_give() -> None:
    done = command("results", "--check")
    assert (done.returncode, done.stdout + done.stderr) == (0, "")


def test_a_figure_changes_in_its_table_alone_and_with_its_interval(tree: Path) -> None:
    assert command("results", "--root", tree).returncode == 0
    assert command("results", "--root", tree, "--check").returncode == 0
    before = page(tree, "real")
    changed(tree, "switch", right=8, count=10)
    check = command("results", "--root", tree, "--check")
    assert check.returncode == 1
    assert "real.md" in check.stdout
    assert page(tree, "real") == before  # a check writes nothing
    assert command("results", "--root", tree).returncode == 0
    # The interval by hand: Wilson, z = 1.96, 8 of 10.
    row = "| jam | 8 of 10, 80.0 % |"
    assert [line for line in page(tree, "real").splitlines() if line.startswith(row)]
    assert row not in before


def test_the_readme_is_filled_between_its_markers_alone(tree: Path) -> None:
    command("results", "--root", tree)
    readme = (tree / "README.md").read_text(encoding="utf-8")
    assert readme.startswith("before\n<!-- results -->\n| what | result |")
    assert readme.endswith("|\n<!-- /results -->\nafter\n")
    assert "](docs/results/table4.md)" in readme
    assert "](table4.md)" in page(tree, "summary")


def test_each_row_of_a_share_has_its_origin(tree: Path) -> None:
    command("results", "--root", tree)
    text = page(tree, "table4")
    part = text.partition("## Table 4, ten times")[2].partition("\n## ")[0]
    head, _, *rows = [line for line in part.splitlines() if line.startswith("|")]
    names = [name.strip() for name in head.strip("|").split("|")]
    assert {"row", "result", "95 % interval"} <= set(names)
    for row in rows:
        cells = dict(zip(names, (cell.strip() for cell in row.strip("|").split("|")), strict=True))
        assert cells["95 % interval"], row
    for name in ("date", "commit", "seed", "developed on", "scored on"):
        assert f"{name} " in part, name


@pytest.mark.parametrize(
    "path", sorted((ROOT / "docs" / "results").glob("*.md")), ids=lambda p: p.stem
)
def test_tables_fit_a_page(path: Path) -> None:
    """Few columns of short cells: on a phone they scroll, at 1300 px no cell has eight lines."""
    rows = [line for line in path.read_text(encoding="utf-8").splitlines() if line[:1] == "|"]
    for row in rows:
        cells = [re.sub(r"\]\(.*?\)", "]", cell.strip()) for cell in row.strip("|").split("|")]
        assert len(cells) <= 6, row
        assert max(map(len, cells[1:]), default=0) <= 60, row


def test_pictures_show_what_the_tables_say(tree: Path) -> None:
    command("results", "--root", tree)
    folder = tree / "docs" / "results" / "plots"
    for picture in folder.glob("*.svg"):
        ElementTree.parse(picture)
    rows = json.loads((KEPT / "injections.json").read_text(encoding="utf-8"))["rows"]
    shares = (folder / "injections_shares.svg").read_text(encoding="utf-8")
    assert shares.count("<circle") == len(rows)
    left, right = 200.0, 200.0 + 480 - 200 - 24
    first = rows[0]["right"] / rows[0]["count"]
    assert f'cx="{left + first * (right - left):.1f}"' in shares
    sizes = (folder / "severity_sizes.svg").read_text(encoding="utf-8")
    ladders = json.loads((KEPT / "severity.json").read_text(encoding="utf-8"))["rows"]
    assert sizes.count("<polyline") == 2 * len(ladders)
    assert "![" in page(tree, "real")


def test_a_picture_of_growing_calibrations_has_each_value_at_its_place(tree: Path) -> None:
    command("results", "--root", tree)
    growth = (tree / "docs" / "results" / "plots" / "law_score_growth.svg").read_text("utf-8")
    rows = json.loads((KEPT / "law_score.json").read_text(encoding="utf-8"))["rows"]
    counted: dict[str, list[dict[str, Any]]] = {}
    for row in rows:
        if found := re.fullmatch(r"(.+), (\d+) recordings", row["name"]):
            counted.setdefault(found[1], []).append(row)
    series = [each for each in counted.values() if len(each) > 2]
    assert len(series) > 3
    assert growth.count("<polyline") >= len(series)
    assert growth.count("<circle") >= sum(map(len, series))
    # The first panel: its bottom is 0, its top the largest end of a range.
    top, bottom = 26.0, 100.0
    most = max(row["high"] for row in series[0])
    ys = [float(y) for y in re.findall(r'cy="([\d.]+)"', growth)][: len(series[0])]
    wanted = [bottom - row["value"] / most * (bottom - top) for row in series[0]]
    assert ys == pytest.approx(wanted, abs=0.06)


@pytest.mark.parametrize(
    ("name", "words"),
    [("stray", "stray.json is on no page"), ("real", "schema_version is 99")],
)
def test_what_cannot_be_shown_is_refused_by_name(tree: Path, name: str, words: str) -> None:
    path = tree / "docs" / "results" / "kept" / f"{name}.json"
    content = json.loads((KEPT / "real.json").read_text(encoding="utf-8"))
    if name == "real":
        content["schema_version"] = 99
    path.write_text(json.dumps(content), encoding="utf-8")
    done = command("results", "--root", tree)
    assert done.returncode == 2
    assert words in done.stderr
    assert done.stderr.count("\n") == 1


SUMMARY = {
    "schema_version": 2,
    "campaign": "short",
    "failed": 0,
    "dates": ["2026-11-22"],
    "commits": ["123456789"],
    "parts": [
        {
            "seed": 7,
            "source": "drawn",
            "configuration": "hybrid",
            "rows": [{"row": "Jam", "right": 3, "count": 4,
                      "scores": {"detection_time_s": {"median": 1.5}}}],
            "scores": {"right": {"right": 3, "count": 4},
                       "false_alarms_per_hour": {"alarms": 1, "hours": 2.0}},
        }
    ],
}  # fmt: skip


def kept_of(tmp_path: Path, summary: dict[str, object], *more: str) -> tuple[int, str]:
    (tmp_path / "summary.json").write_text(json.dumps(summary), encoding="utf-8")
    named = ("--as", "short", "--title", "Short", "--folder", str(tmp_path))
    done = command("keep", tmp_path, *named, *more)
    return done.returncode, done.stderr


def test_an_evaluation_is_kept_with_its_origin(tmp_path: Path) -> None:
    told = ("--developed-on", "seed 1", "--scored-on", "seed 7, once")
    assert kept_of(tmp_path, SUMMARY, *told) == (0, "")
    content = json.loads((tmp_path / "short.json").read_text(encoding="utf-8"))
    assert content["origin"] == {
        "date": "2026-11-22",
        "commit": "123456789",
        "seed": "7",
        "developed_on": "seed 1",
        "scored_on": "seed 7, once",
    }
    jam, whole, alarms = content["rows"]
    assert (jam["name"], jam["right"], jam["count"]) == ("Jam", 3, 4)
    assert (whole["name"], whole["right"], whole["count"]) == ("all", 3, 4)
    assert (alarms["events"], alarms["hours"]) == (1, 2.0)


def test_an_evaluation_without_its_origin_is_refused(tmp_path: Path) -> None:
    status, words = kept_of(tmp_path, {**SUMMARY, "schema_version": 1}, "--scored-on", "seed 7")
    assert status == 2
    assert "evaluate anew" in words
    status, words = kept_of(tmp_path, {**SUMMARY, "failed": 2}, "--scored-on", "seed 7")
    assert status == 2
    assert "2 runs failed" in words
    status, words = kept_of(tmp_path, SUMMARY)
    assert status == 2
    assert "--scored-on" in words


def test_a_bench_writes_its_figures_and_they_are_kept(tmp_path: Path) -> None:
    script = (
        "from summary import Figure, share, write_summary; from pathlib import Path;"
        "write_summary('a', [share('b', 8, 10), Figure('c', 1.23456, 's', 3, 1.0, 2.0, 'd')],"
        "Path('a.json'))"
    )
    environment = {"PYTHONPATH": f"{ROOT / 'bench'}:{ROOT}", "PATH": "/usr/bin:/bin"}
    subprocess.run([sys.executable, "-c", script], cwd=tmp_path, env=environment, check=True)
    content = json.loads((tmp_path / "a.json").read_text(encoding="utf-8"))
    assert {"name", "date", "commit", "backend", "load", "cores"} <= set(content)
    share, value = content["figures"]
    assert [share[key] for key in ("value", "n", "low", "high")] == [80.0, 10, 49.02, 94.33]
    assert value["value"] == 1.235
    named = ("--as", "a", "--title", "A", "--folder", tmp_path / "kept")
    assert command("keep", tmp_path / "a.json", *named).returncode == 0
    kept = json.loads((tmp_path / "kept" / "a.json").read_text(encoding="utf-8"))
    assert kept["origin"]["commit"] == content["commit"]
    assert kept["rows"][1]["against"] == "d"


def test_pairs_count_who_is_right_alone(tmp_path: Path) -> None:
    right = {"truth": "jam", "onset_s": 9.0, "expected": ["jam"], "group": ["jam"],
             "detection_time_s": 1.0, "duration_s": 20.0, "nominal_s": 9.0, "cpu_s": 0.02,
             "alarms_s": [10.0]}  # fmt: skip
    wrong = {**right, "group": ["spall"], "outcome": "ISOLATED", "detection_time_s": 3.0}
    told = {
        "a/1": (right, wrong),
        "a/2": (right, right),
        "a/3": (wrong, right),
        "a/4": (right, wrong),
    }
    lines = [
        {
            "schema_version": 1,
            "id": name,
            "kind": "simulated",
            "row": "Jam",
            "configuration": who,
            **of,
        }
        for name, both in told.items()
        for who, of in zip(("ratio", "hybrid"), both, strict=True)
    ]
    folder = tmp_path / "score"
    folder.mkdir()
    text = "".join(json.dumps(line) + "\n" for line in lines)
    (folder / "results.jsonl").write_text(text, encoding="utf-8")
    options = ("--of", "ratio", "--as", "two", "--title", "t", "--scored-on", "s")
    done = command("pairs", folder, *options, "--folder", tmp_path)
    assert done.returncode == 0, done.stderr
    every, alarms, cost, jam = json.loads((tmp_path / "two.json").read_text(encoding="utf-8"))[
        "rows"
    ]
    assert (every["name"], every["right"], every["count"]) == ("score, a: all", 3, 4)
    assert every["cells"]["the other"] == "2"
    assert every["cells"]["a wrong fault isolated"] == "1, 2"
    assert every["cells"]["right alone, other alone"] == "2, 1"
    assert every["cells"]["detected after"] == "1.00, 2.00 s"
    assert (alarms["events"], alarms["hours"]) == (0, 0.01)
    assert (cost["value"], cost["unit"], cost["cells"]["the other"]) == (1.0, "ms", "1.0")
    assert jam["name"] == "score, a: Jam"
