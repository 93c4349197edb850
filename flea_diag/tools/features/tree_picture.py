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

"""Drawing of a diagnosis tree: left to right, one line per leaf."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from flea_diag.core.choice.diagnosis_tree import Node, leaves, words
from flea_diag.errors import ConfigurationError
from flea_diag.tools.extra import require
from flea_diag.tools.terminal import writing

FORMATS = (".svg", ".png", ".pdf")
COLUMN_INCH, LINE_INCH = 3.4, 0.34
MOST_LEAVES = 300


def draw_tree(node: Node, path: Path) -> None:
    """Draw a tree to a file; its suffix determines the format.

    Raises
    ------
    ConfigurationError
        matplotlib is not installed, the format is unknown, the tree is too large, or the file
        cannot be written.
    """
    if path.suffix not in FORMATS:
        raise ConfigurationError(f"{path}: must end in one of {' '.join(FORMATS)}")
    count = len(list(leaves(node)))
    if count > MOST_LEAVES:
        raise ConfigurationError(
            f"{path}: the tree has {count} leaves, the limit for a drawing is {MOST_LEAVES}: name "
            "fewer faults, or raise --rarest"
        )
    require("plot", str(path))
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    size = COLUMN_INCH * (_depth(node) + 1), LINE_INCH * (count + 1)
    with pyplot.rc_context({"svg.fonttype": "none", "svg.hashsalt": "tree", "font.size": 8}):
        figure, axes = pyplot.subplots(figsize=size)
        axes.set_axis_off()
        axes.set_title(f"expected cost {node.expected_cost:.3g} (standard deviation = 1)")
        _place(axes, node, 0, 0)
        axes.set_xlim(-0.1, _depth(node) + 0.9)
        axes.set_ylim(count - 0.5, -0.8)
        with writing(path):
            figure.savefig(path, bbox_inches="tight", metadata=_undated(path))
        pyplot.close(figure)


def _undated(path: Path) -> dict[str, Any]:
    """Metadata without a date, so that equal trees give equal files."""
    return (
        {} if path.suffix == ".png" else {"Date" if path.suffix == ".svg" else "CreationDate": None}
    )


def _depth(node: Node) -> int:
    return max((1 + _depth(branch.node) for branch in node.branches), default=0)


def _place(axes: Any, node: Node, depth: int, first: int) -> tuple[float, int]:
    """Draw a node and its subtree; return its height and the number of lines."""
    used, heights = 0, []
    for branch in node.branches:
        height, lines = _place(axes, branch.node, depth + 1, first + used)
        heights.append(height)
        used += lines
    own = sum(heights) / len(heights) if heights else float(first)
    for branch, height in zip(node.branches, heights, strict=True):
        axes.plot([depth + 0.02, depth + 1.0], [own, height], color="0.7", linewidth=0.8, zorder=1)
        label = f"{branch.symbol}  {branch.probability:.0%}"
        axes.text(depth + 0.9, height, label, ha="right", va="bottom", color="0.35", zorder=2)
    box = {"boxstyle": "round", "facecolor": "#e8f0fa" if node.feature else "white", "lw": 0.4}
    axes.text(depth, own, words(node), va="center", bbox=box, zorder=3)
    return own, max(used, 1)
