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

"""Each class of ours has a name of its own, and the check finds a planted second one."""

from __future__ import annotations

import ast
from collections import defaultdict
from pathlib import Path

from support.places import ROOT

PACKAGES = ("flea_diag", "flea_sim_driver")


def defined_twice(root: Path) -> dict[str, list[str]]:
    """Class name -> the places that define it, where there are several."""
    places: dict[str, list[str]] = defaultdict(list)
    for package in PACKAGES:
        for path in sorted((root / package).rglob("*.py")):
            tree = ast.parse(path.read_text(encoding="utf-8"))
            for node in ast.walk(tree):
                if isinstance(node, ast.ClassDef):
                    places[node.name].append(f"{path.relative_to(root)}:{node.lineno}")
    return {name: where for name, where in places.items() if len(where) > 1}


def test_no_class_name_is_defined_twice() -> None:
    assert defined_twice(ROOT) == {}


def test_a_planted_second_class_is_found(tmp_path: Path) -> None:
    for place in ("flea_diag/core/a.py", "flea_sim_driver/plant/b.py"):
        path = tmp_path / place
        path.parent.mkdir(parents=True)
        path.write_text("class Planted:\n    pass\n", encoding="utf-8")
    assert defined_twice(tmp_path) == {
        "Planted": ["flea_diag/core/a.py:1", "flea_sim_driver/plant/b.py:1"]
    }
