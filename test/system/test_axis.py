"""The walk of the shipped axis, as its README has it, on messages of an axis that nobody knows."""

from __future__ import annotations

import json
import re
import runpy
import shlex
import shutil
import sys
from pathlib import Path
from typing import Any

import pytest
from support.places import ROOT

from flea_diag.tools.main import main

STAND = ROOT / "config" / "stands" / "axis"
HEALTHY = ("nominal", "nominal_wide", "nominal_triangle", "nominal_trapezoid")
UNIT = 17
"""Its seed: no unit of the calibration."""
MOST_COMMANDS = 4
WALK = re.findall(r"^    ((?:cp|flea) .*lift.*)$", (STAND / "README.md").read_text("utf-8"), re.M)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Recordings of four healthy runs and of a guide that runs dry."""
    place = tmp_path_factory.mktemp("axis")
    given = f"--machine axis --unit-seed {UNIT} --duration 30 --no-vibration".split()
    named = [
        *((f"healthy_{k}", name) for k, name in enumerate(HEALTHY)),
        ("strange", "gear_friction"),
    ]
    for seed, (bag, name) in enumerate(named):
        simulated = str(place / "simulated" / bag)
        assert main(["simulate", name, *given, "--seed", str(100 + seed), "-o", simulated]) == 0
    script = ROOT / "docs" / "tutorial" / "axis_recordings.py"
    with pytest.MonkeyPatch.context() as patch:
        bags = sorted(map(str, (place / "simulated").iterdir()))
        patch.setattr(sys, "argv", [str(script), *bags, "-o", str(place / "recordings")])
        runpy.run_path(str(script), run_name="__main__")
    return place


def walked(folder: Path, *more: str) -> dict[str, Any]:
    """The verdict of the last command of the README."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for line in WALK:
            program, *words = shlex.split(line)
            given = [
                m for w in words for m in (sorted(map(str, Path().glob(w))) if "*" in w else [w])
            ]
            if program == "cp":
                shutil.copytree(STAND, given[-1], dirs_exist_ok=True)
            else:
                assert main([*given, *(more if given[0] == "replay" else ())]) == 0, line
    told: dict[str, Any] = json.loads((folder / "verdict.json").read_text(encoding="utf-8"))
    return told


def test_four_commands_lead_from_bags_to_a_verdict(folder: Path) -> None:
    assert len(WALK) == MOST_COMMANDS
    told = walked(folder, "--json", str(folder / "verdict.json"))
    assert told["outcome"] == "INDISTINGUISHABLE"
    assert set(told["ambiguity_group"]) == {"gear_friction", "jam"}
    assert 12.0 < told["detected_at_s"] < 15.0
    # The brake that holds it at the start is said, and nothing else is.
    (braked,) = told["data_quality"]["mode"]["stretches"]
    assert braked["from_s"] == 0.0
    assert 3.0 < braked["to_s"] < 4.0


def test_another_healthy_run_is_quiet(folder: Path) -> None:
    told = folder / "quiet.json"
    given = ["--machine", "axis", "--duration", "30", "--no-vibration", "--seed", "131"]
    unit = ["--unit-seed", str(UNIT)]
    assert main(["simulate", "nominal_sweep", *given, *unit, "-o", str(folder / "quiet")]) == 0
    stand = ["--stand", "axis", "--json", str(told)]
    assert main(["replay", str(folder / "quiet"), *stand]) == 0
    verdict = json.loads(told.read_text(encoding="utf-8"))
    assert (verdict["outcome"], verdict["episodes"]) == ("NOMINAL", [])
