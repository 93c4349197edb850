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

"""The walks of the shipped machines, as their READMEs have them: four commands and one edited file.

The recordings are of units that no calibration knows.
"""

from __future__ import annotations

import json
import re
import runpy
import shlex
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
import yaml
from support import in_turn
from support.places import ROOT

from flea_diag.tools.main import main

SCRIPT = ROOT / "docs" / "tutorial" / "machine_recordings.py"
MOST_COMMANDS = 4
UNIT = "17"
"""Its seed: no unit of the calibration."""


@dataclass(frozen=True)
class Walk:
    """One machine: healthy motions, a fault, who may be in its group, and where."""

    healthy: tuple[str, ...]
    fault: str
    group: frozenset[str]
    more: tuple[str, ...] = ()
    kind: str = "recordings"
    seconds: int = 24
    edited: dict[str, Any] = field(default_factory=dict)


BRAKE = {
    "topic": "/joint_states",
    "type": "sensor_msgs/msg/JointState",
    "field": "position[lift_brake]",
    "unit": "1",
    "range": [-0.5, 1.5],
}
WIDE = ("nominal", "nominal_wide", "nominal_triangle", "nominal_trapezoid")
WALKS = {
    "axis": Walk(
        WIDE,
        "gear_friction",
        frozenset({"gear_friction", "jam"}),
        seconds=30,
        edited={"brake_engaged": BRAKE},
    ),
    "shoulder": Walk(WIDE, "gear_friction", frozenset({"gear_friction", "jam"})),
    "gimbal": Walk(
        WIDE,
        "bearing_friction",
        frozenset({"bearing_friction", "jam", "actuator_position_bias"}),
        ("--csv",),
        "tables",
    ),
}


def commands(machine: str) -> list[str]:
    """Those of the last part of its README."""
    text = (ROOT / "config" / "stands" / machine / "README.md").read_text("utf-8")
    return re.findall(r"^    (flea .*)$", text[text.index("of your own") :], re.MULTILINE)


def recorded(machine: str, place: Path) -> None:
    """Recordings of healthy runs and of one with a fault."""
    walk = WALKS[machine]
    given = (
        f"--machine {machine} --unit-seed {UNIT} --duration {walk.seconds} --no-vibration".split()
    )
    named = [(f"healthy_{k}", name) for k, name in enumerate(walk.healthy)]
    for seed, (bag, name) in enumerate([*named, ("strange", walk.fault)]):
        simulated = str(place / "simulated" / bag)
        assert main(["simulate", name, *given, "--seed", str(100 + seed), "-o", simulated]) == 0
    with pytest.MonkeyPatch.context() as patch:
        bags = sorted(map(str, (place / "simulated").iterdir()))
        output = str(place / walk.kind)
        patch.setattr(sys, "argv", [str(SCRIPT), machine, *bags, *walk.more, "-o", output])
        runpy.run_path(str(SCRIPT), run_name="__main__")


def edit(machine: str, folder: Path) -> None:
    """The one file that is edited: what the recording cannot say."""
    if WALKS[machine].edited:
        path = folder / "channels.yaml"
        content = yaml.safe_load(path.read_text("utf-8"))
        content["channels"] |= WALKS[machine].edited
        path.write_text(yaml.safe_dump(content, sort_keys=False), "utf-8")


def walked(machine: str, place: Path) -> dict[str, Any]:
    """The verdict of the last command."""
    told = place / "verdict.json"
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(place)
        for line in commands(machine):
            words = [
                m
                for w in shlex.split(line)[1:]
                for m in (sorted(map(str, Path().glob(w))) if "*" in w else [w])
            ]
            more = ["--json", str(told)] if words[0] == "replay" else []
            assert main([*words, *more]) == 0, line
            if words[:2] == ["stand", "new"]:
                edit(machine, Path(words[2]))
    found: dict[str, Any] = json.loads(told.read_text(encoding="utf-8"))
    return found


@pytest.mark.parametrize("machine", in_turn(tuple(WALKS), 3))
def test_four_commands_and_a_file_lead_from_recordings_to_a_verdict(
    machine: str, tmp_path: Path
) -> None:
    recorded(machine, tmp_path)
    assert len(commands(machine)) == MOST_COMMANDS
    told = walked(machine, tmp_path)
    assert told["outcome"] in ("INDISTINGUISHABLE", "ISOLATED")
    assert WALKS[machine].fault in told["ambiguity_group"]
    assert set(told["ambiguity_group"]) <= WALKS[machine].group
    assert 12.0 < told["detected_at_s"] < 16.0
    if machine == "axis":
        # The brake that holds it at the start is said, and nothing else is.
        (braked,) = told["data_quality"]["mode"]["stretches"]
        assert braked["from_s"] == 0.0
        assert 3.0 < braked["to_s"] < 4.0
