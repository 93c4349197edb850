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

"""A fault, a sensor, a feature and a command are each a row, and a function where one is due.

Each test adds one as CONTRIBUTING says, beside what is shipped, and asks a command for it.
"""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from support.places import ROOT

from flea_diag.core.vibration import features
from flea_diag.core.vibration.features import Feature
from flea_diag.core.vibration.window import Window
from flea_diag.tools import main as command_line

Said = Callable[..., str]


@pytest.fixture(name="said")
def _said(capsys: pytest.CaptureFixture[str]) -> Said:
    """What a command prints that ends well."""

    def of(*words: str) -> str:
        assert command_line.main(list(words)) == 0, capsys.readouterr().err
        return capsys.readouterr().out

    return of


@pytest.fixture(name="stand")
def _stand(tmp_path: Path) -> Path:
    """A stand of one's own, copied from the shipped one."""
    return Path(shutil.copytree(ROOT / "config/stands/flea", tmp_path / "mine"))


def add(file: Path, after: str, row: str) -> None:
    """Write a row below a line that stands in the file once."""
    text = file.read_text(encoding="utf-8")
    assert text.count(after) == 1
    file.write_text(text.replace(after, after + row), encoding="utf-8")


@pytest.mark.slow
def test_a_fault_is_one_file(stand: Path, said: Said) -> None:
    """Its signature follows from the graph: grease that stiffens drags when the screw turns."""
    row = """  stiff_grease:
    component: ball screw
    hypotheses: [[screw_viscous_friction+]]
    approach: physics
    onset: incipient
    effects:
      - sizes: [{name: drag, unit: N s/m, moves: {viscous_friction_n_s_per_m: 1}}]
"""
    add(stand / "faults.yaml", "\nfaults:\n", row)
    table = said("model", "signatures", "--stand", str(stand), "--fault", "stiff_grease")
    assert "stiff_grease" in table
    assert "0+(1)" in table.split("stiff_grease")[1]


@pytest.mark.slow
def test_a_sensor_is_two_files(stand: Path, said: Said) -> None:
    """A second tachometer is read off the graph, and has the faults of a sensor."""
    sensor = "  tachometer: {at: shaft, unit: rad/s, noise: 0.5}\n"
    add(stand / "actuator.yaml", "\nsensors:\n", sensor)
    add(stand / "faults.yaml", "\nsensor_errors:\n", "  tachometer: {bias: 200.0, drift: 100.0}\n")
    table = said("model", "signatures", "--stand", str(stand), "--fault", "tachometer_bias")
    assert "tachometer_bias" in table


def test_a_feature_is_a_row_and_a_function(said: Said, monkeypatch: pytest.MonkeyPatch) -> None:
    """The list of features shows it with the first line of its docstring."""

    def middle(window: Window) -> float:
        """Median of the magnitude, to be told from its mean."""
        return float(np.median(np.abs(window.signal)))

    row = Feature("middle", "m/s^2", middle, cost=2.0)
    monkeypatch.setitem(features.FEATURES, "middle", row)
    assert "Median of the magnitude" in said("features", "list")


def test_a_command_is_a_row_and_a_module(said: Said, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its words and options are those of the module."""
    module = ModuleType("flea_diag.tools.hello")
    module.NAME, module.SUMMARY = "hello", "say a name"
    module.add_arguments = lambda parser: parser.add_argument("name")
    module.run = lambda arguments: sys.stdout.write(f"hello {arguments.name}\n") * 0
    monkeypatch.setitem(sys.modules, module.__name__, module)
    monkeypatch.setitem(command_line.MODULES, "hello", "hello")
    assert said("hello", "stand") == "hello stand\n"
    assert "hello" in command_line.parser_of(command_line.commands()).format_help()
