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

"""Runs the notebooks of docs/notebooks and keeps what they show: text, tables, pictures.

    .venv/bin/python bench/results/notebooks.py            all, in place
    .venv/bin/python bench/results/notebooks.py NAME...    these

A cell runs as in a notebook: what it prints is kept, and what its last line is. No kernel is
needed, so the tests run the same cells in the same way.
"""

from __future__ import annotations

import ast
import base64
import contextlib
import io
import json
import os
import sys
import tempfile
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).resolve().parents[2] / "docs" / "notebooks"
NAMES = ("csv_to_diagnosis", "calibration", "own_diagnoser", "remaining_life")
"""Those that need nothing but flea_diag with its extras."""
DPI = 72


def main(names: list[str]) -> int:
    """Run notebooks and write them back with their outputs."""
    for name in names or NAMES:
        path = FOLDER / f"{name}.ipynb"
        notebook = json.loads(path.read_text(encoding="utf-8"))
        with tempfile.TemporaryDirectory() as place:
            run(notebook, Path(place))
        text = json.dumps(notebook, indent=1, ensure_ascii=False)
        path.write_text(text + "\n", encoding="utf-8")
        print(path)
    return 0


def run(notebook: dict[str, Any], place: Path) -> dict[str, Any]:
    """Run the cells in a folder, each with its outputs put into it; the names that they define."""
    names: dict[str, Any] = {"__name__": "__main__"}
    number = 0
    with contextlib.chdir(place) if sys.version_info >= (3, 11) else _chdir(place):
        for cell in notebook["cells"]:
            if cell["cell_type"] == "code":
                number += 1
                cell["execution_count"] = number
                cell["outputs"] = _outputs("".join(cell["source"]), names, number)
    return names


@contextlib.contextmanager
def _chdir(place: Path) -> Any:
    before = Path.cwd()
    os.chdir(place)
    try:
        yield
    finally:
        os.chdir(before)


def _outputs(source: str, names: dict[str, Any], number: int) -> list[dict[str, Any]]:
    """What a cell prints, and what its last line is."""
    tree = ast.parse(source)
    last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(tree, "<cell>", "exec"), names)
        code = ast.Expression(last.value) if isinstance(last, ast.Expr) else None
        shown = eval(compile(code, "<cell>", "eval"), names) if code is not None else None
    found: list[dict[str, Any]] = []
    if printed.getvalue():
        text = printed.getvalue().splitlines(keepends=True)
        found.append({"output_type": "stream", "name": "stdout", "text": text})
    if shown is not None:
        data = {"text/plain": repr(shown).splitlines(keepends=True), **_rich(shown)}
        result = {"output_type": "execute_result", "execution_count": number}
        found.append({**result, "metadata": {}, "data": data})
    return found


def _rich(shown: Any) -> dict[str, Any]:
    """A picture or a table, where the value is one."""
    if hasattr(shown, "savefig"):
        picture = io.BytesIO()
        shown.savefig(picture, dpi=DPI, metadata={"Software": None})
        return {"image/png": base64.b64encode(picture.getvalue()).decode()}
    if hasattr(shown, "_repr_html_"):
        return {"text/html": shown._repr_html_().splitlines(keepends=True)}
    return {}


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
