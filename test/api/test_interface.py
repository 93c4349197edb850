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

"""The public names: light to import, documented, the same for people and for type checkers."""

from __future__ import annotations

import ast
import inspect
import subprocess
import sys
from pathlib import Path

import pytest
from support.places import ROOT

import flea_diag as fd

PUBLIC = sorted(set(fd.__all__) - {"__version__"})
HEAVY = ("numpy", "scipy", "pandas", "xarray", "matplotlib", "numba", "rclpy", "yaml")
MOST_S = 0.3
UNITS = ("seconds", " s", "SI", "Hz", "in ns", "standard deviations", "0 to 1", "probability")


def public_members(thing: object) -> list[tuple[str, object]]:
    """A class with its own public functions and properties, or the function itself."""
    if not inspect.isclass(thing):
        return [("", thing)]
    own = [(name, value) for name, value in vars(thing).items() if not name.startswith("_")]
    described = [(n, getattr(v, "__func__", v)) for n, v in own if getattr(v, "__doc__", None)]
    callables = [(n, v) for n, v in described if callable(v) or hasattr(v, "fget")]
    return [("", thing), *callables, *((n, v) for n, v in described if hasattr(v, "func"))]


def test_the_import_is_light() -> None:
    code = (
        "import sys, time; began = time.perf_counter(); import flea_diag; "
        "took = time.perf_counter() - began; "
        f"print(took, *(name for name in {HEAVY} if name in sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    took_s, *loaded = done.stdout.split()
    assert float(took_s) < MOST_S
    assert loaded == []


@pytest.mark.parametrize("name", PUBLIC)
def test_each_public_name_is_documented(name: str) -> None:
    thing = getattr(fd, name)
    for member, value in public_members(thing):
        doc = inspect.getdoc(value)
        assert doc, f"{name}.{member} has no docstring"
        plain = getattr(value, "fget", None) or getattr(value, "func", None) or value
        if inspect.isfunction(plain) and len(inspect.signature(plain).parameters) > 2:
            assert "Parameters" in doc, f"{name}.{member} does not describe its parameters"
            assert "Raises" in doc, f"{name}.{member} does not name its errors"


@pytest.mark.parametrize("name", ["open", "diagnose", "Diagnosis", "Table", "Recording", "Stream"])
def test_what_holds_numbers_states_units(name: str) -> None:
    text = "\n".join(inspect.getdoc(value) or "" for _, value in public_members(getattr(fd, name)))
    assert any(unit in text for unit in UNITS)
    assert "shape" in text or name not in ("Table", "Recording", "Diagnosis", "diagnose")


def test_type_checkers_see_the_same_names() -> None:
    stub = ast.parse((ROOT / "flea_diag" / "__init__.pyi").read_text(encoding="utf-8"))
    told = {
        alias.asname or alias.name: f"{node.module}.{alias.name}"
        for node in stub.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert sorted(map(str, told)) == PUBLIC
    for name, place in told.items():
        assert f"{getattr(fd, str(name)).__module__}.{place.rsplit('.', 1)[1]}" == place


def test_an_unknown_name_is_none_of_ours() -> None:
    with pytest.raises(AttributeError, match="no attribute 'diagnoze'"):
        fd.diagnoze  # noqa: B018
    assert set(PUBLIC) <= set(dir(fd))


def test_names_are_documented_for_readers() -> None:
    page = (ROOT / "docs" / "python.md").read_text(encoding="utf-8")
    assert [name for name in PUBLIC if f"fd.{name}" not in page] == []


def test_the_package_says_that_it_is_typed() -> None:
    assert (Path(fd.__file__).parent / "py.typed").exists()
