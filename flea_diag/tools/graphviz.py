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
