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

"""Baselines and ablations that diagnose the same recordings, for comparison.

A baseline is another method; an ablation is the hybrid diagnosis without one of its parts.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

from flea_diag.configuration.files import config_path
from flea_diag.configuration.stand import Stand
from flea_diag.errors import ConfigurationError, shown
from flea_diag.stages import Stage
from flea_diag.tools.campaign.campaign import CLASSIFIER
from flea_diag.wire.blocks import Block, ScanBlock
from flea_diag.wire.records import ChannelTable, Record, Scan, VibrationBlock

PAPER_TABLE = "feature_table_paper.yaml"
ACCELEROMETER = "accelerometer"


@dataclass(frozen=True)
class Setting:
    """What a diagnoser rests on: a stand, the nominal bags of its calibration, a network."""

    stand: Stand
    nominal: tuple[Path, ...] = ()
    classifier: Path | None = None


@dataclass(frozen=True)
class Baseline:
    """One diagnoser; ``make`` gives a new stage."""

    name: str
    summary: str
    make: Callable[[Setting], Stage]


class WithoutVibration:
    """A stage that receives no vibration, as on a stand without accelerometers."""

    def __init__(self, stage: Any) -> None:
        self._stage = stage
        self.consumes = tuple(kind for kind in stage.consumes if kind is not VibrationBlock)

    def handle(self, record: Record) -> tuple[Record, ...]:
        """Output of the stage, without accelerometers."""
        if isinstance(record, VibrationBlock):
            return ()
        if isinstance(record, ChannelTable):
            slow = [row for row in record.channels if not row.name.startswith(ACCELEROMETER)]
            record = replace(record, channels=tuple(slow))
        caused: tuple[Record, ...] = self._stage.handle(record)
        return caused

    def handle_block(self, block: ScanBlock) -> tuple[Record | Block, ...]:
        """Scans pass unchanged."""
        caused: tuple[Record | Block, ...] = self._stage.handle_block(block)
        return caused

    def finish(self) -> tuple[Record, ...]:
        """End of the input."""
        held: tuple[Record, ...] = self._stage.finish()
        return held


def _hybrid(**given: Any) -> Callable[[Setting], Stage]:
    def make(setting: Setting) -> Stage:
        from flea_diag.configuration.component import make_pipeline

        return make_pipeline(setting.stand, **given)

    return make


def _paper(setting: Setting) -> Stage:
    stand = replace(setting.stand, features=config_path(PAPER_TABLE))
    return _hybrid(likelihood=False, strategy="paper")(replace(setting, stand=stand))


def _without_vibration(setting: Setting) -> Stage:
    return WithoutVibration(_hybrid()(setting))


def _structural(setting: Setting) -> Stage:
    from flea_diag.configuration.calibrations import learned
    from flea_diag.configuration.knowledge import effects, knowledge
    from flea_diag.core.signatures.structural import without_signs
    from flea_diag.stages.isolator.isolator import IsolatorParameters, IsolatorStage
    from flea_diag.stages.observer.observer import ObserverStage
    from flea_diag.stages.observer.observer_parameters import ObserverParameters
    from flea_diag.stages.pipeline import Pipeline

    calibration = learned(setting.stand)
    known = knowledge(setting.stand, calibration)
    signatures = {quadrant: without_signs(table) for quadrant, table in known.signatures.items()}
    isolator = IsolatorStage(
        replace(known, signatures=signatures),
        IsolatorParameters(likelihood=False, gating=False, source="replay"),
    )
    observer = ObserverStage(calibration, effects(setting.stand, calibration), ObserverParameters())
    return WithoutVibration(Pipeline((observer, isolator)))


def _limits(setting: Setting) -> Stage:
    from flea_diag.configuration.calibrations import learned
    from flea_diag.configuration.knowledge import knowledge
    from flea_diag.stages.baselines.limit_check import LimitCheckStage

    if not setting.nominal:
        raise ConfigurationError(
            "limit checks need nominal bags to learn from: name some under `learn_from` "
            "in the campaign"
        )
    known = knowledge(setting.stand, learned(setting.stand))
    return LimitCheckStage(_channel_limits(setting.nominal), known.faults)


def _evidence(setting: Setting) -> Stage:
    from flea_diag.configuration.component import evidence_pipeline
    from flea_diag.tools.evaluate.evidence import evidence_stand

    known = evidence_stand(setting.stand, setting.nominal)
    return evidence_pipeline(known, setting.stand)


def _classifier(setting: Setting) -> Stage:
    from flea_diag.stages.baselines.feature_classifier import FeatureClassifierStage
    from flea_diag.tools.features.classifier import read_classifier

    if setting.classifier is None:
        raise ConfigurationError(
            "the feature-only classifier needs a network: train one with `flea features train`, "
            "and name it under `classifier` in the campaign"
        )
    orders = setting.stand.kinematics.orders()
    return FeatureClassifierStage(read_classifier(setting.classifier), orders)


@cache
def _channel_limits(bags: Sequence[Path]) -> dict[str, tuple[float, float]]:
    from flea_diag.stages.baselines.limit_check import learned_limits
    from flea_diag.wire.bags.bag import BagReader

    scans = (
        record
        for bag in bags
        for _, record in BagReader(bag).records((Scan,))
        if isinstance(record, Scan)
    )
    return learned_limits(scans)


BASELINES: dict[str, Baseline] = {
    row.name: row
    for row in (
        Baseline("hybrid", "the whole method, as `flea replay` runs it", _hybrid()),
        Baseline("without_vibration", "hybrid, without accelerometers", _without_vibration),
        Baseline(
            "without_gating",
            "hybrid, symbols compared in all quadrants, likelihoods at once",
            _hybrid(gating=False),
        ),
        Baseline("without_likelihood", "hybrid, signs and features", _hybrid(likelihood=False)),
        Baseline(
            "paper",
            "the paper's isolation: signs, then its literal tree over its Table 3",
            _paper,
        ),
        Baseline("structural", "residuals that react, without signs or features", _structural),
        Baseline("limit_checks", "each channel against its nominal extremes", _limits),
        Baseline(
            "evidence",
            "one evidence by the law of healthy recordings, and tests of sensors",
            _evidence,
        ),
        Baseline(CLASSIFIER, "all vibration features into a network, no model", _classifier),
    )
}


def baseline(name: str) -> Baseline:
    """A row of the table.

    Raises
    ------
    ConfigurationError
        No such row; the message lists all.
    """
    if name not in BASELINES:
        known = ", ".join(BASELINES)
        raise ConfigurationError(f"configuration {shown(name)} is unknown, choose of: {known}")
    return BASELINES[name]
