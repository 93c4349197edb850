"""The whole diagnosis on simulated runs that nothing was learned from: right answers and cost.

Each run is one physical unit of its own, healthy until the onset, with a motion, a load and a
size of the fault that are drawn from its seed. It goes through the same stages as live data.
"""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from flea_diag.configuration import load_features, make_pipeline
from flea_diag.core.choice.classifier import Classifier
from flea_diag.core.choice.feature_table import FaultFeatureTable
from flea_diag.core.vibration.features import compute_all
from flea_diag.core.vibration.nominal_range import MOVING_RAD_S
from flea_diag.core.vibration.window import NotComputableError
from flea_diag.stages.extractor.extractor import ExtractorStage
from flea_diag.stages.extractor.scan_ring import SECOND_NS
from flea_diag.stages.extractor.windows import Windows
from flea_diag.tools.features.bench import FLEA_SCREW
from flea_diag.tools.features.classifier import call, read_classifier
from flea_diag.tools.features.judge import judge
from flea_diag.tools.features.samples import FeatureRun, Grid, run_of
from flea_diag.tools.features.stand import drawn_scenario
from flea_diag.tools.workers import worker_pool
from flea_diag.wire.records import (
    AmbiguityGroup,
    ChannelTable,
    FeatureRequest,
    FeatureValue,
    Record,
    Scan,
    Truth,
    VibrationBlock,
)
from flea_sim_driver.scenario.scenario_file import scenario_from_mapping
from flea_sim_driver.stand import Stand

ONSET_S = 8.0
DURATION_S = 22.0
WINDOWS = 3
"""Windows in motion that features alone, and the classifier, may use: as many as an episode."""

EVERY_S = 1.0
"""Computing always: all features of the table, once a second of data."""


@dataclass(frozen=True)
class Plan:
    """What all runs of a study have in common: the faults, by what they are told apart."""

    faults: tuple[str, ...]
    table: str = "feature_table.yaml"
    classifier: Path | None = None


@dataclass(frozen=True)
class Study:
    """One run: what was there, what was said of it, and what vibration cost (CPU seconds).

    ``group``: what the whole diagnosis leaves, which is told of nothing. ``alone``: what features
    alone leave of the faults of the study, on the first windows in motion after the onset.
    ``called``: the classifier's word for the same windows, of all its classes, nominal among them.
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
    alone: tuple[str, ...] = ()
    called: str = ""

    @property
    def resolved(self) -> bool:
        """Whether the truth alone is left."""
        return self.group == (self.fault,)

    @property
    def kept(self) -> bool:
        """Whether the truth is among what is left."""
        return self.fault in self.group

    @property
    def told(self) -> bool:
        """Whether features alone leave the truth alone."""
        return self.alone == (self.fault,)

    @property
    def classified(self) -> bool:
        """Whether the classifier names the truth."""
        return self.called == self.fault


def study_run(fault: str, seed: int, plan: Plan) -> Study:
    """Simulate and diagnose one run."""
    mapping = drawn_scenario(seed, fault, DURATION_S, ONSET_S)
    stand = Stand(scenario_from_mapping(mapping, f"seed {seed}"))
    records = [r for r in stand if isinstance(r, ChannelTable | Scan | VibrationBlock | Truth)]
    pipeline = make_pipeline(None)
    said = [caused for record in records for caused in pipeline.handle(record)]
    said += pipeline.finish()
    groups = [record for record in said if isinstance(record, AmbiguityGroup)]
    requests = [record for record in said if isinstance(record, FeatureRequest)]
    answers = [record for record in said if isinstance(record, FeatureValue)]
    table, run = load_features(plan.table), after_onset(records)
    walks = judge([run], table, plan.faults, windows=WINDOWS)
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
        walks[0].left if walks else (),
        called(run, read_classifier(plan.classifier)) if plan.classifier else "",
    )


def after_onset(records: Sequence[Record]) -> FeatureRun:
    """All features of every window in which the fault was there throughout."""
    truths = [record for record in records if isinstance(record, Truth)]
    onset_ns = max((truth.onset_ns for truth in truths), default=0)
    late = [record for record in records if record.stamp_ns >= onset_ns]
    return run_of("", late, truths, Grid(orders=FLEA_SCREW.orders()))


def called(run: FeatureRun, classifier: Classifier) -> str:
    """The class that the classifier finds most probable; empty where the shaft stands still."""
    found = call([run], classifier, classifier.faults, WINDOWS)
    return found[0].called if found else ""


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
    gc.collect()  # not the garbage of what ran before
    return min(_once_s(work) for _ in range(rounds))


def _once_s(work: Callable[[], None]) -> float:
    begin = time.process_time_ns()
    work()
    return (time.process_time_ns() - begin) / 1e9


def study(
    plan: Plan, seeds: Iterable[int], faults: Sequence[str] = (), jobs: int = 1
) -> Iterator[Study]:
    """Runs of each fault with each seed as they are done, in order; ``jobs`` processes."""
    todo = [(fault, seed, plan) for seed in seeds for fault in faults or plan.faults]
    if jobs == 1:
        yield from (study_run(*job) for job in todo)
        return
    with worker_pool(jobs) as pool:
        yield from pool.map(study_run, *zip(*todo, strict=True))
