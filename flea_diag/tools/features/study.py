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

"""Accuracy and cost of the whole diagnosis on simulated runs not used for learning.

Each run is a unit of its own, healthy until the onset, with motion, load and fault size drawn by
its seed. It is processed by the same stages as live data.
"""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from flea_diag.configuration.component import make_pipeline
from flea_diag.configuration.knowledge import load_features
from flea_diag.configuration.stand import Stand
from flea_diag.core.choice.classifier import Perceptron
from flea_diag.core.choice.feature_table import FaultFeatureTable
from flea_diag.core.vibration.features import compute_all
from flea_diag.core.vibration.nominal_range import MOVING_RAD_S
from flea_diag.core.vibration.window import NotComputableError
from flea_diag.stages.extractor.extractor import ExtractorStage
from flea_diag.stages.extractor.windows import Windows
from flea_diag.stages.isolator.parameters import IsolatorParameters
from flea_diag.tools.features.classifier import call, read_classifier
from flea_diag.tools.features.judge import judge
from flea_diag.tools.features.samples import FeatureRun, Grid, run_of
from flea_diag.tools.features.stand import drawn_scenario
from flea_diag.tools.workers import worker_pool
from flea_diag.wire.records import (
    SECOND_NS,
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
from flea_sim_driver.stand import SimulatedStand

ONSET_S = 8.0
DURATION_S = 22.0
WINDOWS = IsolatorParameters().feature_windows
"""Windows in motion available to features alone and to the classifier, as in an episode."""

EVERY_S = 1.0
"""Period of eager computation: all features of the table for every second of data."""


@dataclass(frozen=True)
class Plan:
    """Settings common to all runs of a study: faults, stand, feature table, classifier.

    The whole diagnosis is that of the stand; ``table`` is what features alone are judged by.
    """

    faults: tuple[str, ...]
    stand: Stand
    table: Path
    classifier: Path | None = None


@dataclass(frozen=True)
class Study:
    """One run: truth, results, and cost of vibration processing (CPU seconds).

    ``group`` is the final group of the whole diagnosis, without prior information. ``alone``: the
    faults of the study left by features alone, on the first windows in motion after the onset.
    ``called``: the class (including nominal) given by the classifier for the same windows.
    ``moved_s``: time in motion after the onset. ``lazy_s``: buffering, vibration monitor,
    decoding, and the requested features. ``eager_s``: decoding, and all features of the table
    every second with shared spectra.
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
        """Whether only the true fault remains."""
        return self.group == (self.fault,)

    @property
    def kept(self) -> bool:
        """Whether the true fault remains."""
        return self.fault in self.group

    @property
    def told(self) -> bool:
        """Whether features alone leave only the true fault."""
        return self.alone == (self.fault,)

    @property
    def classified(self) -> bool:
        """Whether the classifier gives the true fault."""
        return self.called == self.fault


def study_run(fault: str, seed: int, plan: Plan) -> Study:
    """Simulate and diagnose one run."""
    mapping = drawn_scenario(seed, fault, DURATION_S, ONSET_S)
    simulated = SimulatedStand(scenario_from_mapping(mapping, f"seed {seed}"))
    records = [r for r in simulated if isinstance(r, ChannelTable | Scan | VibrationBlock | Truth)]
    pipeline = make_pipeline(plan.stand)
    said = [caused for record in records for caused in pipeline.handle(record)]
    said += pipeline.finish()
    groups = [record for record in said if isinstance(record, AmbiguityGroup)]
    requests = [record for record in said if isinstance(record, FeatureRequest)]
    answers = [record for record in said if isinstance(record, FeatureValue)]
    table = load_features(plan.table)
    run = after_onset(records, table.nominal.orders)
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


def after_onset(records: Sequence[Record], orders: Mapping[str, float]) -> FeatureRun:
    """All features of every window with the fault present throughout."""
    truths = [record for record in records if isinstance(record, Truth)]
    onset_ns = max((truth.onset_ns for truth in truths), default=0)
    late = [record for record in records if record.stamp_ns >= onset_ns]
    return run_of("", late, truths, Grid(orders=orders))


def called(run: FeatureRun, classifier: Perceptron) -> str:
    """Most probable class by the classifier; empty without motion."""
    found = call([run], classifier, classifier.faults, WINDOWS)
    return found[0].called if found else ""


def moved_s(records: Sequence[Record]) -> float:
    """Time in motion after the onset, s."""
    scans = [record for record in records if isinstance(record, Scan)]
    onset_ns = scans[0].stamp_ns + round(ONSET_S * SECOND_NS)
    late = [abs(scan.value("motor_speed")) for scan in scans if scan.stamp_ns >= onset_ns]
    share = sum(speed >= MOVING_RAD_S for speed in late) / max(len(late), 1)
    return share * (DURATION_S - ONSET_S)


def lazy_s(
    records: Sequence[Record], requests: Sequence[FeatureRequest], table: FaultFeatureTable
) -> float:
    """CPU time of the extractor for a stream and its feature requests."""
    stream = [r for r in records if type(r) in ExtractorStage.consumes]
    merged = sorted([*stream, *requests], key=lambda record: record.stamp_ns)

    def extract() -> None:
        extractor = ExtractorStage(table)
        for record in merged:
            extractor.handle(record)

    return cpu_s(extract)


def eager_s(records: Iterable[Record], table: FaultFeatureTable) -> float:
    """CPU time of all features of a table for every second of the same stream."""
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
    """Least CPU time of several calls, since other load on the machine only adds to it."""
    gc.collect()  # so that garbage of earlier code is not collected during the measurement
    return min(_once_s(work) for _ in range(rounds))


def _once_s(work: Callable[[], None]) -> float:
    begin = time.process_time_ns()
    work()
    return (time.process_time_ns() - begin) / 1e9


def study(
    plan: Plan, seeds: Iterable[int], faults: Sequence[str] = (), jobs: int = 1
) -> Iterator[Study]:
    """Runs of each fault with each seed, in order, as they finish; ``jobs`` processes."""
    todo = [(fault, seed, plan) for seed in seeds for fault in faults or plan.faults]
    if jobs == 1:
        yield from (study_run(*job) for job in todo)
        return
    with worker_pool(jobs) as pool:
        yield from pool.map(study_run, *zip(*todo, strict=True))
