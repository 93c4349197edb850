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

"""What changed between two diagnoses, when, and by which evidence; and what did not."""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import Any

import pytest
from support.decisions import BAGS

from flea_diag.configuration.component import make_pipeline
from flea_diag.configuration.stand import load_stand
from flea_diag.tools.campaign.result_log import RESULTS
from flea_diag.tools.campaign.run_result import RunResult
from flea_diag.tools.main import main
from flea_diag.tools.replay.replay import replay


@pytest.fixture(scope="module")
def replayed() -> dict[str, Any]:
    return replay(BAGS / "winding_short", make_pipeline(load_stand()))


def written(folder: Path, name: str, content: Any) -> str:
    path = folder / name
    path.write_text(json.dumps(content), encoding="utf-8")
    return str(path)


def changed(replayed: dict[str, Any]) -> dict[str, Any]:
    """The same with one fault more that was kept to the end."""
    other = copy.deepcopy(replayed)
    episode = other["episodes"][0]
    fault = next(iter(episode["dropped"]))
    del episode["dropped"][fault]
    episode["kept"][fault] = "residual x: saw +, expected +"
    episode["ambiguity_group"].append(fault)
    episode["steps"][-1]["members"].append(fault)
    other["ambiguity_group"] = episode["ambiguity_group"]
    return other


def test_equal_replays_are_equal(
    tmp_path: Path, replayed: dict[str, Any], capsys: pytest.CaptureFixture[str]
) -> None:
    a = written(tmp_path, "a.json", replayed)
    b = written(tmp_path, "b.json", [replayed])
    assert main(["diff", a, b]) == 0
    assert "1 runs compared, 0 decided otherwise" in capsys.readouterr().out


def test_what_opened_an_episode_is_what_the_verdict_says(replayed: dict[str, Any]) -> None:
    (episode,) = replayed["episodes"]
    assert episode["detected_by"].startswith("parity_")
    assert "limit" in episode["detected_by"]


def test_a_change_is_named_with_its_time_and_evidence(
    tmp_path: Path, replayed: dict[str, Any], capsys: pytest.CaptureFixture[str]
) -> None:
    other = changed(replayed)
    fault = (set(other["ambiguity_group"]) - set(replayed["ambiguity_group"])).pop()
    reason = replayed["episodes"][0]["dropped"][fault]
    a, b = written(tmp_path, "a.json", replayed), written(tmp_path, "b.json", other)
    assert main(["diff", a, b, "--json", str(tmp_path / "c.json")]) == 1
    said = capsys.readouterr().out
    assert f"{fault}: A dropped it ({reason}); B kept it (residual x" in said
    assert f"they differ at {replayed['episodes'][0]['steps'][-1]['at_s']} s" in said
    report = json.loads((tmp_path / "c.json").read_text(encoding="utf-8"))
    assert [change["run"] for change in report["changed"]] == ["winding_short"]


def test_what_is_in_one_alone_is_a_change(tmp_path: Path, replayed: dict[str, Any]) -> None:
    quiet = {**replayed, "episodes": [], "ambiguity_group": [], "outcome": "NOMINAL"}
    a, b = written(tmp_path, "a.json", replayed), written(tmp_path, "b.json", quiet)
    assert main(["diff", a, b, "-q"]) == 1
    assert main(["diff", a, written(tmp_path, "c.json", []), "-q"]) == 1


def test_evaluations_say_who_is_no_longer_right(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    right = RunResult("a/1", "real", "Nominal", outcome="NOMINAL", cpu_s=1.0)
    wrong = RunResult("a/1", "real", "Nominal", outcome="ISOLATED", alarms_s=(3.0,), cpu_s=2.0)
    for name, result in (("a", right), ("b", wrong)):
        (tmp_path / name).mkdir()
        (tmp_path / name / RESULTS).write_text(result.to_line() + "\n", encoding="utf-8")
    a, b = str(tmp_path / "a"), str(tmp_path / "b")
    assert main(["diff", a, b]) == 1
    said = capsys.readouterr().out
    assert "a/1 (NO LONGER RIGHT)" in said
    assert "NOMINAL  ->  ISOLATED at 3.00 s" in said
    assert main(["diff", b, a]) == 1
    assert "(now right)" in capsys.readouterr().out
    assert main(["diff", a, f"{a}/{RESULTS}"]) == 0


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("{", "cannot be read as JSON"),
        ("[1]", "replay summary must be a mapping"),
        ('{"schema_version": 1, "episodes": [1]}', "not the JSON of a replay"),
        (
            '{"schema_version": 1, "episodes": [{"outcome": "ISOLATED", "detected_at_s": null}]}',
            "write it with flea replay",
        ),
        (None, "cannot be"),
    ],
)
def test_what_cannot_be_compared_ends_with_2(
    tmp_path: Path, content: str | None, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "a.json"
    if content is not None:
        path.write_text(content, encoding="utf-8")
    assert main(["diff", str(path), str(path)]) == 2
    assert words in capsys.readouterr().err
