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

"""Report of a study: table, plot and JSON file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict
from itertools import pairwise
from pathlib import Path
from typing import Any

from flea_diag.errors import ConfigurationError
from flea_diag.formats import stamped
from flea_diag.tools.extra import require
from flea_diag.tools.features.study import Study
from flea_diag.tools.interval import wilson
from flea_diag.tools.terminal import write_json

MOVED_S = 2.0
"""Time in motion that a fault needs to appear; runs with small strokes may have less."""

WAYS: dict[str, tuple[str, Callable[[Study], bool]]] = {
    "diagnosis": ("tab:blue", lambda run: run.resolved),
    "features": ("tab:orange", lambda run: run.told),
    "classifier": ("tab:green", lambda run: run.classified),
}
"""Method of diagnosis -> colour in plots, and test whether a run was correct."""


def ways(runs: Sequence[Study]) -> list[str]:
    """The methods that were applied to these runs."""
    return [name for name in WAYS if name != "classifier" or any(run.called for run in runs)]


def study_report(runs: Sequence[Study]) -> str:
    """Share resolved, by fault and by third of the sizes, and CPU cost."""
    shown = ways(runs)
    lines = [f"{'fault':24s}{'n':>5s}" + "".join(f"{name:>24s}" for name in shown)]
    lines[0] += f"{'kept':>7s}{'features':>10s}"
    for fault in dict.fromkeys(run.fault for run in runs):
        rows = [run for run in runs if run.fault == fault]
        lines.append(_line(fault, rows, shown))
        lines += [_line(f"  size {_span(part)}", part, shown) for part in thirds(rows)]
    lines.append(_line("all", runs, shown))
    moved = [run for run in runs if run.moved_s >= MOVED_S]
    if moved:
        lines.append(_line(f"  {MOVED_S:g} s in motion", moved, shown))
    ratio = sum(run.lazy_s for run in runs) / sum(run.eager_s for run in runs)
    answer = max(run.answer_ms for run in runs)
    lines.append(f"lazy over always: {ratio:.2%} of CPU; slowest answer {answer:.1f} ms")
    lines += [_miss(run) for run in runs if not run.resolved]
    return "\n".join(lines)


def _miss(run: Study) -> str:
    """Result of a run that was not resolved to the true fault."""
    named = f"; classifier: {run.called}" if run.called else ""
    return (
        f"  {run.fault} seed {run.seed} size {run.size:.3g}, {run.moved_s:.1f} s in motion: "
        f"{', '.join(run.group) or 'nothing'}; features: {', '.join(run.alone)}{named}"
    )


def thirds(runs: Sequence[Study]) -> list[list[Study]]:
    """Runs in three parts by size, smallest first; a single part if all have one size."""
    ordered = sorted(runs, key=lambda run: run.size)
    cuts = [round(len(ordered) * k / 3) for k in range(4)]
    return [ordered[a:b] for a, b in pairwise(cuts) if b > a]


def write_study(path: Path, runs: Sequence[Study]) -> None:
    """Write one row per run as JSON.

    Raises
    ------
    ConfigurationError
        The file cannot be written.
    """
    judged = {name: right for name, (_, right) in WAYS.items()}
    rows = [{**asdict(run), "right": {n: r(run) for n, r in judged.items()}} for run in runs]
    write_json(path, stamped("feature study", {"runs": rows}))


def draw_study(path: Path, runs: Sequence[Study]) -> None:
    """Plot the share resolved against the size of each fault, with Wilson's intervals.

    Raises
    ------
    ConfigurationError
        matplotlib is not installed, or the file cannot be written.
    """
    require("plot", str(path))
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    faults = list(dict.fromkeys(run.fault for run in runs))
    with pyplot.rc_context({"svg.hashsalt": "study", "font.size": 9}):
        figure, row = pyplot.subplots(
            1, len(faults), figsize=(3.0 * len(faults), 2.8), sharey=True, squeeze=False
        )
        for axes, fault in zip(row[0], faults, strict=True):
            _curves(axes, [run for run in runs if run.fault == fault and run.size > 0.0])
            axes.set_title(fault)
        row[0][0].set_ylabel("resolved to the truth")
        row[0][0].legend(loc="lower right")
        figure.tight_layout()
        try:
            figure.savefig(path)
        except (OSError, ValueError) as error:
            raise ConfigurationError(f"{path}: cannot be written: {error}") from error
        finally:
            pyplot.close(figure)


def _curves(axes: Any, runs: Sequence[Study]) -> None:
    """Plot one point per third of the sizes and method, at the median size of the third."""
    for number, name in enumerate(ways(runs)):
        colour, right = WAYS[name]
        points = []
        for part in thirds(runs):
            hits, n = sum(map(right, part)), len(part)
            size = part[n // 2].size * 1.06**number
            axes.plot([size, size], wilson(hits, n), color=colour, alpha=0.4)
            points.append((size, hits / n))
        axes.plot(*zip(*points, strict=True), "o-", color=colour, markersize=4, label=name)
    axes.set_xscale("log")
    axes.set_ylim(0.0, 1.05)
    axes.set_xlabel("size of the fault")


def _span(runs: Sequence[Study]) -> str:
    return f"{runs[0].size:.3g} to {runs[-1].size:.3g}"


def _line(name: str, runs: Sequence[Study], shown: Sequence[str]) -> str:
    n = len(runs)
    hits = {way: sum(map(WAYS[way][1], runs)) for way in shown}
    shares = "".join(
        "{:>24s}".format(f"{count / n:.3f} ({low:.3f} to {high:.3f})")
        for count in hits.values()
        for low, high in [wilson(count, n)]
    )
    kept = sum(run.kept for run in runs) / n
    asked = sum(len(run.features) for run in runs) / n
    return f"{name:24s}{n:5d}{shares}{kept:7.3f}{asked:10.2f}"
