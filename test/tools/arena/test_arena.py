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

"""Diagnosers of others run beside ours; one that fails is a failed row, and the rest goes on."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import yaml
from support.decisions import BAGS, ROOT

import flea_diag as fd
from flea_diag.errors import ConfigurationError, DiagnoserError
from flea_diag.tools.arena.child import Child
from flea_diag.tools.arena.entrant import entrant, entrants
from flea_diag.tools.arena.stage import ForeignStage
from flea_diag.tools.campaign.result_log import read_results
from flea_diag.tools.main import main
from flea_diag.wire.records import AmbiguityGroup, Detection, Outcome, Record, Scan

HERE = Path(__file__).with_name("diagnosers.py")
TOLD = {"name": "s", "channels": {"x": "A"}, "period_s": 0.01, "faults": {"jam": "", "spall": ""}}
DRIFT = "motor_temperature_drift"
LIMIT_S, MEMORY_MB = 60.0, 512
FAILURES = {
    "Raises": r"ValueError: no idea \(diagnosers\.py:\d+\)",
    "Greedy": r"needed more than 512 MB \(--memory-mb\): MemoryError",
    "Dies": "its process ended with status 3",
    "Typo": "answered 'jamm', no fault of this stand, did you mean jam",
    "Nan": "no line of JSON",
    "Words": "gave jam the weight 'likely': 0 or more is needed",
}


def run(command: tuple[str, ...], limit_s: float = LIMIT_S, rows: int = 8) -> list[Record]:
    """What a stage of this process says to some rows."""
    child = Child(command, limit_s, MEMORY_MB)
    try:
        stage = ForeignStage(child, TOLD)
        said = [r for k in range(rows) for r in stage.handle(Scan(k * 10**7, ("x",), (1.0,)))]
        return [*said, *stage.finish()]
    finally:
        child.close()


def of(name: str) -> tuple[str, ...]:
    return entrant(f"{HERE}:{name}").command


def test_answers_become_verdicts() -> None:
    said = run(of("Course"))
    groups = [record for record in said if isinstance(record, AmbiguityGroup)]
    told = [(g.outcome, g.episode, [m.fault for m in g.members], g.stamp_ns) for g in groups]
    assert told == [
        (Outcome.NOMINAL, 0, [], 0),
        (Outcome.INDISTINGUISHABLE, 1, ["jam", "spall"], 10**7),
        (Outcome.ISOLATED, 1, ["jam"], 3 * 10**7),
        (Outcome.NOMINAL, 0, [], 4 * 10**7),
        (Outcome.UNEXPLAINED, 2, [], 5 * 10**7),
        (Outcome.NOMINAL, 0, [], 6 * 10**7),
    ]
    assert [m.probability for m in groups[1].members] == [0.75, 0.25]
    assert [r.stamp_ns for r in said if isinstance(r, Detection)] == [10**7, 5 * 10**7]


@pytest.mark.parametrize("name", FAILURES)
def test_a_failing_one_says_why(name: str) -> None:
    with pytest.raises(DiagnoserError, match=FAILURES[name]):
        run(of(name))


def test_one_that_hangs_is_ended() -> None:
    with pytest.raises(DiagnoserError, match=r"took longer than 1 s \(--limit-s\): ended"):
        run(of("Hangs"), limit_s=1.0)


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("echo hello", "wrote 'hello', no line of JSON"),
        ("head -c 2000000 /dev/zero", "wrote a line of more than 1048576 bytes"),
        ("false", "its process ended with status 1"),
        ("nowhere_at_all", "nowhere_at_all cannot be started: No such file"),
        ("echo 5", "answered 5: a mapping is needed"),
        ("ls /nowhere_at_all", "ended with status 2: .*No such file"),
    ],
)
def test_a_process_that_speaks_something_else(command: str, words: str) -> None:
    with pytest.raises(DiagnoserError, match=words):
        run(entrant(f"process:{command}").command)


def test_any_program_of_lines_takes_part() -> None:
    """``cat`` answers each line by the line itself, which holds no faults: never an alarm."""
    groups = [record for record in run(("cat",)) if isinstance(record, AmbiguityGroup)]
    assert [group.outcome for group in groups] == [Outcome.NOMINAL]


def test_names_are_checked_before_any_run() -> None:
    first, second = entrants([f"{HERE}:Silent", f"mine={HERE}:Silent"], ["hybrid"])
    assert (first.label, second.label) == ("Silent", "mine")
    assert first.content == second.content != ""
    for text, words in (
        (f"{HERE}:Silent", "Silent is taken, name it"),
        ("nowhere.py:X", "no file .*nowhere.py"),
        ("nobody", "no package installed here names it under flea_diag.diagnosers"),
        ("process:", "name a command after process:"),
    ):
        with pytest.raises(ConfigurationError, match=words):
            entrants([f"{HERE}:Silent", text], [])


def test_an_installed_package_may_name_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    told = tmp_path / "others-1.0.dist-info"
    told.mkdir()
    (told / "METADATA").write_text("Metadata-Version: 2.1\nName: others\nVersion: 1.0\n")
    lines = "[flea_diag.diagnosers]\nsilent = diagnosers:Silent\n"
    (told / "entry_points.txt").write_text(lines, encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setenv("PYTHONPATH", f"{ROOT}:{HERE.parent}")
    made = entrant("silent")
    assert made.label == "silent"
    groups = [record for record in run(made.command) if isinstance(record, AmbiguityGroup)]
    assert [group.outcome for group in groups] == [Outcome.NOMINAL]


@pytest.fixture(scope="module")
def evaluated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two examples, one that raises, and limit checks of ours, on two runs."""
    folder = tmp_path_factory.mktemp("arena")
    learned = [folder / f"nominal_{seed}" for seed in (31, 32)]
    for bag, seed in zip(learned, (31, 32), strict=True):
        fd.simulate("nominal", seed=seed, duration_s=20.0).save(bag)
    bags = [str(BAGS / name) for name in (DRIFT, "nominal")]
    campaign: dict[str, Any] = {
        "schema_version": 1,
        "name": "arena",
        "configurations": "limit_checks",
        "learn_from": [str(bag) for bag in learned],
        "sources": [{"kind": "recordings", "name": "kept", "files": bags}],
    }
    path = folder / "arena.yaml"
    path.write_text(yaml.safe_dump(campaign), encoding="utf-8")
    named = [f"{ROOT}/examples/limits.py:Limits", f"{ROOT}/examples/outliers.py:Outliers"]
    chosen = [f"--diagnoser={place}" for place in (*named, f"{HERE}:Raises")]
    output = folder / "out"
    assert main(["evaluate", str(path), "-o", str(output), "-j", "1", "-q", *chosen]) == 1
    return output


def test_two_foreign_diagnosers_are_scored_beside_ours(evaluated: Path) -> None:
    results = {(r.configuration, r.row): r for r in read_results(evaluated)}
    assert len(results) == 8
    assert results["Limits", "nominal"].right
    drift = results["Limits", DRIFT]
    assert DRIFT in drift.group
    assert results["Outliers", DRIFT].detected
    assert results["Outliers", DRIFT].outcome == "UNEXPLAINED"
    assert 1e6 < drift.peak_memory_bytes < 1e9
    assert drift.cpu_s > 0.01
    for row in (DRIFT, "nominal"):
        assert results["Raises", row].failure.startswith("ValueError: no idea")


def test_the_report_has_a_leaderboard(evaluated: Path) -> None:
    page = (evaluated / "report.html").read_text(encoding="utf-8")
    board = page.partition("<h3>Leaderboard</h3>")[2].partition("</table>")[0]
    rows = board.split("<tr>")[2:]
    names = [row.partition("</td>")[0].removeprefix("<td>").replace("<wbr>", "") for row in rows]
    assert sorted(names) == ["Limits", "Outliers", "Raises", "limit_checks"]
    assert names[-1] == "Raises"
    summary = json.loads((evaluated / "summary.json").read_text(encoding="utf-8"))
    assert summary["failed"] == 2
