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

"""Drawing of DOT graphs by the program Graphviz."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

from flea_diag.errors import ConfigurationError
from flea_diag.tools.terminal import write_text

LIMIT_S = 60.0


def draw(dot: str, target: Path) -> None:
    """Draw a graph as SVG.

    Raises
    ------
    ConfigurationError
        Graphviz is not installed or rejects the graph, or the file cannot be written.
    """
    program = shutil.which("dot")
    if program is None:
        raise ConfigurationError(
            f"{target}: Graphviz is not installed, needed for SVG: install the package graphviz, "
            "or print DOT text with --dot"
        )
    drawn = subprocess.run(
        [program, "-Tsvg"], input=dot, capture_output=True, text=True, check=False, timeout=LIMIT_S
    )
    if drawn.returncode:
        reason = (drawn.stderr.strip().splitlines() or ["no reason given"])[0]
        raise ConfigurationError(f"{target}: Graphviz could not draw it: {reason}")
    write_text(target, drawn.stdout)
