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

"""The likelihood ratio test of a stand, learned from nominal bags."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from flea_diag.configuration.calibrations import learned
from flea_diag.configuration.knowledge import effects, knowledge
from flea_diag.configuration.stand import Stand
from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.faults.fault import Fault
from flea_diag.core.likelihood.effect_set import EffectSet
from flea_diag.core.likelihood_ratio import ratio_test
from flea_diag.core.likelihood_ratio.fault_signatures import FaultSignatures
from flea_diag.core.likelihood_ratio.ratio_test import RatioTest
from flea_diag.core.likelihood_ratio.residual_window import ResidualWindow, WindowMeans
from flea_diag.core.likelihood_ratio.unit_design import unit_design
from flea_diag.core.run_law.run_windows import WINDOW_S
from flea_diag.stages.baselines.likelihood_ratio import LikelihoodRatioStage, ResidualColumns
from flea_diag.stages.baselines.sensor_alarms import SensorAlarms
from flea_diag.stages.evidence.residual_source import ResidualSource
from flea_diag.stages.pipeline import Pipeline
from flea_diag.wire.bags.bag import BagReader
from flea_diag.wire.blocks import ResidualBlock, ScanBlock, block_of
from flea_diag.wire.records import ChannelTable, Residual, Scan


@dataclass(frozen=True)
class RatioBaseline:
    """What the stage of a stand is made of."""

    calibration: Calibration
    effects: EffectSet
    faults: Mapping[str, Fault]
    columns: ResidualColumns
    test: RatioTest
    window_scans: int

    def stage(self) -> Pipeline:
        """A new diagnoser."""
        tests = [row.name for row in self.effects.residuals.sensor_rows]
        alarms = SensorAlarms(tests, self.faults)
        judge = LikelihoodRatioStage(self.test, self.columns, alarms, self.window_scans)
        return Pipeline((ResidualSource(self.calibration, self.effects), judge))


def _residuals(bag: Path, source: Pipeline) -> Iterator[ResidualBlock]:
    for record in BagReader(bag).blocks((ChannelTable, Scan)):
        by_block = isinstance(record, ScanBlock)
        for caused in source.handle_block(record) if by_block else source.handle(record):
            if isinstance(caused, ResidualBlock):
                yield caused
            elif isinstance(caused, Residual):
                yield block_of(caused)


@cache
def ratio_baseline(stand: Stand, bags: tuple[Path, ...]) -> RatioBaseline:
    """The test of a stand, with noise and limit from these nominal bags."""
    calibration = learned(stand)
    known = effects(stand, calibration)
    rows, faults = known.residuals, knowledge(stand, calibration).faults
    names = tuple(name for name in rows.weighed if calibration.limit(name) is not None)
    tolerance = dict(
        zip(known.differences, calibration.differences(known.differences), strict=True)
    )
    parameters = calibration.parameters
    signatures = FaultSignatures.of(
        known.bound(parameters),
        names,
        known.basis_of(parameters),
        unit_design(known, parameters, tolerance, names),
    )
    columns = ResidualColumns(names, rows.in_motion, len(known.names))
    scans = max(1, round(WINDOW_S / calibration.period_s))
    recordings = [_windows(bag, ResidualSource(calibration, known), columns, scans) for bag in bags]
    test = ratio_test.learned(signatures, recordings, calibration.false_alarms_per_hour)
    return RatioBaseline(calibration, known, faults, columns, test, scans)


def _windows(
    bag: Path, source: ResidualSource, columns: ResidualColumns, scans: int
) -> list[ResidualWindow]:
    """Windows of a recording."""
    means = WindowMeans(scans)
    blocks = _residuals(bag, Pipeline((source,)))
    return [window for block in blocks for _, window in means.add(*columns.of(block))]
