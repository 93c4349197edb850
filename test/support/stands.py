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

"""Calibrations, stages and records of the linear actuator, shared by the tests of the stages."""

from __future__ import annotations

import fcntl
import hashlib
import os
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from pathlib import Path

import numpy as np

from flea_diag.configuration import knowledge as of_stand
from flea_diag.configuration.calibrations import load_calibration
from flea_diag.configuration.stand import load_stand
from flea_diag.core.calibration.calibration import Calibration, NominalRun
from flea_diag.core.residuals.channel_units import UNITS
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.stages.isolator.isolator import IsolatorParameters, IsolatorStage, Knowledge
from flea_diag.stages.observer.observer import ObserverStage
from flea_diag.stages.observer.observer_parameters import ObserverParameters
from flea_diag.stages.pipeline import Pipeline
from flea_diag.tools.calibrate.calibrate import write_calibration
from flea_diag.tools.calibrate.nominal_recording import NominalRecording
from flea_diag.tools.calibrate.procedure import calibrate
from flea_diag.tools.evaluate.case_run import in_blocks
from flea_diag.wire.blocks import ResidualBlock, ScanBlock
from flea_diag.wire.records import AmbiguityGroup, ChannelInfo, ChannelTable, Record, Scan
from support.models import linear_ema as ema

PERIOD_NS = 10_000_000
START_NS = 1_000_000_000_000
STAND = load_stand(features="feature_table_paper.yaml")


def shared_calibration(name: str, make: Callable[[], Calibration]) -> Calibration:
    """The calibration of this name, made once a run of the tests: ten seconds of a processor.

    What one worker has made, the others read.
    """
    folder = Path(os.environ["SHARED_BY_WORKERS"]) / "calibrations"
    folder.mkdir(exist_ok=True)
    target = folder / f"{hashlib.sha256(name.encode()).hexdigest()}.yaml"
    with target.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not target.exists():
            write_calibration(target, make())
        return load_calibration(target)


@cache
def calibration(channels: tuple[str, ...] = ema.STAND, sampling: str = "mean") -> Calibration:
    """Learned from the healthy runs, for a stand with these channels."""

    def made() -> Calibration:
        recordings = [
            NominalRecording(
                NominalRun(f"run{n}", ema.rows(columns, channels)), "s", channels, sampling, 0.01
            )
            for n, columns in enumerate(ema.nominal_runs())
        ]
        return calibrate(recordings, "actuator.yaml", 0.1)

    kind = "linear_ema" if sampling == "mean" else f"linear_ema {sampling}"
    return shared_calibration(f"{kind} {channels}", made)


@cache
def relations(channels: tuple[str, ...] = ema.STAND) -> RelationSet:
    """What runs on a stand with these channels."""
    return of_stand.relations(STAND, calibration(channels))


def knowledge(channels: tuple[str, ...] = ema.STAND) -> Knowledge:
    """What the isolator knows of that stand."""
    return of_stand.knowledge(STAND, calibration(channels))


def observer(channels: tuple[str, ...] = ema.STAND, **parameters: float) -> ObserverStage:
    """A fresh observer."""
    known = calibration(channels)
    return ObserverStage(known, of_stand.effects(STAND, known), ObserverParameters(**parameters))


def isolator(channels: tuple[str, ...] = ema.STAND, **parameters: float) -> IsolatorStage:
    """A fresh isolator."""
    return IsolatorStage(knowledge(channels), IsolatorParameters(**parameters))


def pipeline(channels: tuple[str, ...] = ema.STAND) -> Pipeline:
    """Both, without vibration."""
    return Pipeline((observer(channels), isolator(channels)))


def table(channels: tuple[str, ...] = ema.STAND, extra: tuple[str, ...] = ()) -> ChannelTable:
    """Wide ranges for all."""
    rows = (ChannelInfo(c, UNITS.get(c, ""), -1e4, 1e4, 100.0) for c in channels + extra)
    return ChannelTable(START_NS, "stand", tuple(rows))


def scans(
    columns: ema.Columns, channels: tuple[str, ...] = ema.STAND, start_ns: int = START_NS
) -> list[Scan]:
    """A run as scans."""
    values = np.stack([columns[c] for c in channels], axis=1).tolist()
    return [Scan(start_ns + k * PERIOD_NS, channels, tuple(row)) for k, row in enumerate(values)]


def feed(stage: ObserverStage | Pipeline, records: Iterable[Record]) -> list[Record]:
    """Everything that a stage says to these records, and at the end of the stream."""
    out = [said for record in records for said in stage.handle(record)]
    out += getattr(stage, "finish", tuple)()
    return out


def replay(stage: ObserverStage | Pipeline, records: Iterable[Record]) -> list[Record]:
    """What ``feed`` gives, in a sixth of its time: scans that follow each other go in blocks.

    That both are the same of each kind is the subject of ``test_blocks.py``.
    """
    pipeline = stage if isinstance(stage, Pipeline) else Pipeline((stage,))
    return [*said_in_blocks(pipeline, records), *pipeline.finish()]


def said_in_blocks(pipeline: Pipeline, records: Iterable[Record]) -> Iterator[Record]:
    """``replay`` of a stream that goes on."""
    for record in in_blocks(records):
        by_block = isinstance(record, ScanBlock)
        for said in pipeline.handle_block(record) if by_block else pipeline.handle(record):
            yield from said.records() if isinstance(said, ResidualBlock) else (said,)


def of(kind: type, records: Iterable[Record]) -> list:
    """Records of one kind."""
    return [record for record in records if type(record) is kind]


def verdict(records: Iterable[Record]) -> AmbiguityGroup:
    """The last group."""
    return of(AmbiguityGroup, records)[-1]


def members(group: AmbiguityGroup) -> set[str]:
    """Faults still possible."""
    return {candidate.fault for candidate in group.members}
