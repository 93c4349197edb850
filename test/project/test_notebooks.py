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

"""The notebooks run, and say what they are kept to say."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import pytest
from support import in_turn
from support.places import ROOT, script

FOLDER = ROOT / "docs" / "notebooks"


RUNNER = script("bench/results/notebooks.py")


def texts(notebook: dict[str, Any]) -> list[str]:
    """What the cells show, as text; the numbers may differ in their last digits elsewhere."""
    outputs = [output for cell in notebook["cells"] for output in cell.get("outputs", ())]
    return ["".join(o.get("text", o.get("data", {}).get("text/plain", ""))) for o in outputs]


@pytest.mark.parametrize("name", in_turn(RUNNER.NAMES, 2))
def test_a_notebook_runs_and_says_what_it_is_kept_to_say(
    compiled: None, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    notebook = json.loads((FOLDER / f"{name}.ipynb").read_text(encoding="utf-8"))
    kept = texts(notebook)
    RUNNER.run(notebook, tmp_path)
    said = texts(notebook)
    assert len(said) == len(kept)
    for before, after in zip(kept, said, strict=True):
        words = [word for word in before.split() if word.isidentifier()]
        assert [word for word in after.split() if word.isidentifier()] == words
    pictures = [o for c in notebook["cells"] for o in c.get("outputs", ()) if _is_picture(o)]
    assert len(pictures) == sum("plot(" in "".join(c["source"]) for c in notebook["cells"])


def _is_picture(output: dict[str, Any]) -> bool:
    return "image/png" in output.get("data", {})


def test_the_site_shows_them_with_their_pictures() -> None:
    hook = script("docs/hooks/notebooks.py")
    notebook = json.loads((FOLDER / "calibration.ipynb").read_text(encoding="utf-8"))
    pictures: dict[str, bytes] = {}
    page = "\n\n".join(hook._blocks(notebook, "calibration", pictures))
    assert page.count("![](calibration_") == len(pictures) == 2
    assert all(content.startswith(b"\x89PNG") for content in pictures.values())
    assert "<table" in page
    assert "<h1" not in page


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.ipynb")), ids=lambda path: path.stem)
def test_no_path_of_a_machine_is_kept(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert str(ROOT) not in text
    assert sys.prefix not in text
