"""The whole diagnosis on simulated runs that nothing was learned from: right answers and cost.

Each run is one physical unit of its own, healthy until the onset, with a motion, a load and a
size of the fault that are drawn from its seed. It goes through the same stages as live data.
"""

from __future__ import annotations

import gc
import math
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from dataclasses import asdict, dataclass
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from flea_diag.configuration import load_features, make_pipeline
from flea_diag.core.feature_table import FaultFeatureTable
from flea_diag.core.features import compute_all
from flea_diag.core.nominal_range import MOVING_RAD_S
from flea_diag.core.window import NotComputableError
from flea_diag.errors import ConfigurationError
from flea_diag.stages.extractor import ExtractorStage
from flea_diag.stages.scan_ring import SECOND_NS
from flea_diag.stages.windows import Windows
from flea_diag.tools.extra import require
from flea_diag.tools.feature_stand import drawn_scenario
from flea_diag.tools.interval import wilson
from flea_diag.tools.terminal import write_json
from flea_diag.wire.records import (
    AmbiguityGroup,
    ChannelTable,
    FeatureRequest,
    FeatureValue,
    Record,
    Scan,
    VibrationBlock,
)
from flea_sim_driver.scenario import scenario_from_mapping
from flea_sim_driver.stand import Stand

ONSET_S = 8.0
DURATION_S = 22.0
MOVED_S = 2.0
"""Motion that a fault needs to show: with the small strokes some runs hardly move at all."""

EVERY_S = 1.0
"""Computing always: all features of the table, once a second of data."""


@dataclass(frozen=True)
class Study:
    """One run: what was there, what was said of it, and what vibration cost (CPU seconds).

    ``moved_s``: how long the shaft turned after the onset. ``lazy_s``: blocks kept, sentinel,
    decoding, the features asked for. ``eager_s``: decoding, and all features of the table every
    second, spectra shared.
    """

    fault: str
    seed: int
    size: float
    moved_s: float
    group: tuple[str, ...]
    features: tuple[str, ...]
    answer_ms: float
    lazy_s: float
    eager_s: float

    @property
    def resolved(self) -> bool:
        """Whether the truth alone is left."""
        return self.group == (self.fault,)

    @property
    def kept(self) -> bool:
        """Whether the truth is among what is left."""
        return self.fault in self.group


def study_run(job: tuple[str, int], table_name: str) -> Study:
    """Simulate and diagnose one run."""
    fault, seed = job
    mapping = drawn_scenario(seed, fault, DURATION_S, ONSET_S)
    stand = Stand(scenario_from_mapping(mapping, f"seed {seed}"))
    records = [r for r in stand if isinstance(r, ChannelTable | Scan | VibrationBlock)]
    pipeline = make_pipeline(None)
    said = [caused for record in records for caused in pipeline.handle(record)]
    said += pipeline.finish()
    groups = [record for record in said if isinstance(record, AmbiguityGroup)]
    requests = [record for record in said if isinstance(record, FeatureRequest)]
    answers = [record for record in said if isinstance(record, FeatureValue)]
    table = load_features(table_name)
    return Study(
        fault,
        seed,
        mapping["faults"][0]["size"],
        moved_s(records),
        tuple(sorted(member.fault for member in groups[-1].members)) if groups else (),
        tuple(request.feature for request in requests),
        max((answer.cost_ms for answer in answers), default=0.0),
        lazy_s(records, requests, table),
        eager_s(records, table),
    )


def moved_s(records: Sequence[Record]) -> float:
    """How long the shaft turned after the onset, s."""
    scans = [record for record in records if isinstance(record, Scan)]
    onset_ns = scans[0].stamp_ns + round(ONSET_S * SECOND_NS)
    late = [abs(scan.value("motor_speed")) for scan in scans if scan.stamp_ns >= onset_ns]
    share = sum(speed >= MOVING_RAD_S for speed in late) / max(len(late), 1)
    return share * (DURATION_S - ONSET_S)


def lazy_s(
    records: Sequence[Record], requests: Sequence[FeatureRequest], table: FaultFeatureTable
) -> float:
    """CPU time of the extractor on a stream and on the requests that came with it."""
    stream = [r for r in records if type(r) in ExtractorStage.consumes]
    merged = sorted([*stream, *requests], key=lambda record: record.stamp_ns)

    def extract() -> None:
        extractor = ExtractorStage(table)
        for record in merged:
            extractor.handle(record)

    return cpu_s(extract)


def eager_s(records: Iterable[Record], table: FaultFeatureTable) -> float:
    """CPU time of all features of a table on every second of the same stream."""
    stream = [record for record in records if isinstance(record, Scan | VibrationBlock)]
    hop_ns = round(EVERY_S * SECOND_NS)

    def compute() -> None:
        windows, due_ns = Windows(2.0 * EVERY_S, 0.002, 0.05, table.nominal.orders), 0
        for record in stream:
            windows.add(record)
            due_ns = due_ns or record.stamp_ns + hop_ns
            if windows.scans.end_ns > 0 and windows.vibration.end_ns > 0 and windows.covers(due_ns):
                with suppress(NotComputableError):
                    compute_all(table.features, windows.cut(due_ns - hop_ns, due_ns))
                due_ns += hop_ns

    return cpu_s(compute)


def cpu_s(work: Callable[[], None], rounds: int = 3) -> float:
    """CPU time of one call, the least of some: what else the machine does only adds to it."""
    least = math.inf
    for _ in range(rounds):
        gc.collect()  # not the garbage of what ran before
        begin = time.process_time_ns()
        work()
        least = min(least, (time.process_time_ns() - begin) / 1e9)
    return least


def study(faults: Iterable[str], seeds: Iterable[int], table: str, jobs: int = 1) -> list[Study]:
    """Runs of each fault with each seed; ``jobs`` processes share the work."""
    todo = [(fault, seed) for seed in seeds for fault in faults]
    work = partial(study_run, table_name=table)
    if jobs == 1:
        return [work(job) for job in todo]
    with ProcessPoolExecutor(jobs) as pool:
        return list(pool.map(work, todo))


def study_report(runs: Sequence[Study]) -> str:
    """What was resolved, by fault and by third of the sizes, and what it cost."""
    lines = [f"{'fault':24s}{'n':>5s}{'resolved':>10s}{'95 %':>17s}{'kept':>7s}{'features':>10s}"]
    for fault in dict.fromkeys(run.fault for run in runs):
        rows = [run for run in runs if run.fault == fault]
        lines.append(_line(fault, rows))
        lines += [_line(f"  size {_span(part)}", part) for part in thirds(rows)]
    lines.append(_line("all", runs))
    moved = [run for run in runs if run.moved_s >= MOVED_S]
    if moved:
        lines.append(_line(f"  {MOVED_S:g} s in motion", moved))
    ratio = sum(run.lazy_s for run in runs) / sum(run.eager_s for run in runs)
    answer = np.array([run.answer_ms for run in runs])
    lines.append(f"lazy over always: {ratio:.2%} of CPU; slowest answer {answer.max():.1f} ms")
    lines += [
        f"  {run.fault} seed {run.seed} size {run.size:.3g}: {', '.join(run.group) or 'nothing'}"
        for run in runs
        if not run.resolved
    ]
    return "\n".join(lines)


def thirds(runs: Sequence[Study]) -> list[list[Study]]:
    """Runs by size in three parts, smallest first; all that have one size in one part."""
    ordered = sorted(runs, key=lambda run: run.size)
    cuts = [round(len(ordered) * k / 3) for k in range(4)]
    return [ordered[a:b] for a, b in pairwise(cuts) if b > a]


def write_study(path: Path, runs: Sequence[Study]) -> None:
    """Write one row a run as JSON.

    Raises
    ------
    ConfigurationError
        When the file cannot be written.
    """
    rows = [{**asdict(run), "resolved": run.resolved, "kept": run.kept} for run in runs]
    write_json(str(path), {"schema_version": 1, "runs": rows})


def draw_study(path: Path, runs: Sequence[Study]) -> None:
    """Draw the share resolved against the size of each fault, with Wilson's intervals.

    Raises
    ------
    ConfigurationError
        Without matplotlib, or where the file cannot be written.
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
            _curve(axes, [run for run in runs if run.fault == fault and run.size > 0.0])
            axes.set_title(fault)
        row[0][0].set_ylabel("resolved to the truth")
        figure.tight_layout()
        try:
            figure.savefig(path)
        except (OSError, ValueError) as error:
            raise ConfigurationError(f"{path}: cannot be written: {error}") from error
        finally:
            pyplot.close(figure)


def _curve(axes: Any, runs: Sequence[Study]) -> None:
    """One point a third of the sizes, at its median."""
    for part in thirds(runs):
        hits, n = sum(run.resolved for run in part), len(part)
        low, high = wilson(hits, n)
        size = part[n // 2].size
        axes.plot([size, size], [low, high], color="0.6")
        axes.plot(size, hits / n, "o", color="tab:blue")
        axes.annotate(f"{hits}/{n}", (size, hits / n), (4, -10), textcoords="offset points")
    axes.set_xscale("log")
    axes.set_ylim(0.0, 1.05)
    axes.set_xlabel("size of the fault")


def _span(runs: Sequence[Study]) -> str:
    return f"{runs[0].size:.3g} to {runs[-1].size:.3g}"


def _line(name: str, runs: Sequence[Study]) -> str:
    n, hits = len(runs), sum(run.resolved for run in runs)
    low, high = wilson(hits, n)
    kept = sum(run.kept for run in runs) / n
    asked = sum(len(run.features) for run in runs) / n
    interval = f"{low:.3f} to {high:.3f}"
    return f"{name:24s}{n:5d}{hits / n:10.3f}{interval:>17s}{kept:7.3f}{asked:10.2f}"
