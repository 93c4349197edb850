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

"""Products of limits: refused by their number before they are listed, said where they are many."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml

from flea_diag.errors import ConfigurationError
from flea_diag.tools.campaign.campaign import campaign_from_mapping
from flea_diag.tools.campaign.case import plan
from flea_diag.tools.campaign.recording_set import RecordingSet
from flea_diag.tools.campaign.run_count import run_count
from flea_diag.tools.planned_runs import check_planned

ROOT = Path(__file__).resolve().parents[2]
BOUNDED = """
import resource, sys
resource.setrlimit(resource.RLIMIT_DATA, (500 << 20, 500 << 20))
resource.setrlimit(resource.RLIMIT_CPU, (20, 20))
from flea_diag.tools.main import main
sys.exit(main(sys.argv[1:]))
"""
"""The command with 500 MB and 20 processor seconds; most of these pass in starting it."""


def drawn(rows: int, cases: int, times: int) -> dict[str, Any]:
    made = [{"title": f"Jam {k}", "fault": "jam", "cases": cases} for k in range(rows)]
    return {"kind": "drawn", "name": "d", "times": times, "rows": made}


def scenarios(files: int, times: int) -> dict[str, Any]:
    return {"kind": "scenarios", "name": "s", "times": times, "files": ["jam"] * files}


def injections(cases: int) -> dict[str, Any]:
    files = str(ROOT / "bags" / "nominal")
    return {"kind": "injections", "name": "i", "cases": cases, "ladder": True, "files": files}


def content(*sources: dict[str, Any], configurations: int = 1) -> dict[str, Any]:
    names = ["hybrid"] * configurations
    return {
        "schema_version": 1, "name": "big", "configurations": names, "sources": list(sources)
    }  # fmt: skip


ENORMOUS: dict[str, tuple[dict[str, Any], str]] = {
    "rows x cases x times": (content(drawn(100, 10_000, 1000)), "1 000 000 000"),
    "one row": (content(drawn(1, 10_000, 1000)), "10 000 000"),
    "just above": (content(drawn(1, 1001, 1000)), "1 001 000"),
    "scenarios x times": (content(scenarios(9000, 1000)), "9 000 000"),
    "configurations": (content(drawn(1, 1000, 1), configurations=9000), "9 000 000"),
    "sum of sources": (content(drawn(1, 600, 1000), scenarios(500, 1000)), "1 100 000"),
}


def called(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", BOUNDED, *arguments]
    return subprocess.run(
        command, cwd=ROOT, capture_output=True, text=True, timeout=120, check=False
    )


@pytest.mark.parametrize("name", ENORMOUS)
def test_an_enormous_campaign_is_refused_before_it_is_listed(name: str, tmp_path: Path) -> None:
    mapping, count = ENORMOUS[name]
    file = tmp_path / "big.yaml"
    file.write_text(yaml.safe_dump(mapping))
    done = called("evaluate", str(file), "-o", str(tmp_path / "out"))
    assert done.returncode == 2, done.stderr
    assert done.stderr == (
        f"flea: big: {count} runs are planned, the limit is 1 000 000: "
        "plan fewer, or allow them with --allow-large\n"
    )
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("study", "--seeds", "0:999999999"), "features study: 3 999 999 996 runs"),
        (("learn", "--seeds", "0:999999999", "-o", "t.yaml"), "features: 11 999 999 988 runs"),
        (("train", "--seeds", "5:99999999999", "-o", "c.json"), "features: 1 199 999 999 928 runs"),
    ],
)
def test_an_enormous_range_of_seeds_is_refused(arguments: tuple[str, ...], words: str) -> None:
    done = called("features", *arguments)
    assert done.returncode == 2, done.stderr
    assert f"{words} are planned, the limit is 1 000 000" in done.stderr


@pytest.mark.parametrize(
    "sources",
    [(drawn(3, 2, 2),), (scenarios(1, 3),), (injections(2),), (drawn(1, 2, 1), injections(1))],
)
def test_the_number_is_that_of_the_list(
    sources: tuple[dict[str, Any], ...], tmp_path: Path
) -> None:
    campaign = campaign_from_mapping(content(*sources, configurations=2), "c")
    recordings = RecordingSet(campaign, tmp_path)
    assert run_count(campaign, recordings) == len(plan(campaign, recordings))


def test_many_runs_are_said_and_too_many_can_be_allowed(capsys: pytest.CaptureFixture[str]) -> None:
    check_planned(10_000, "c")
    assert capsys.readouterr().err == ""
    check_planned(10_001, "c")
    assert capsys.readouterr().err == "flea: c: 10 001 runs are planned\n"
    check_planned(1_000_000, "c")
    check_planned(1_000_001, "c", allow_large=True)
    assert "1 000 001 runs are planned" in capsys.readouterr().err
    with pytest.raises(ConfigurationError, match="1 000 001 runs are planned"):
        check_planned(1_000_001, "c")
