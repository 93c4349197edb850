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

"""The feature-only classifier as a baseline: on vibration of the simulated stand, and without."""

from __future__ import annotations

import functools
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.decisions import BAGS
from support.stand_runs import fault, records

from flea_diag.configuration.stand import load_stand
from flea_diag.core.choice.classifier import Perceptron
from flea_diag.errors import ConfigurationError
from flea_diag.stages.baselines.feature_classifier import IN_A_ROW, FeatureClassifierStage
from flea_diag.tools.campaign.campaign import CLASSIFIER, campaign_from_mapping
from flea_diag.tools.campaign.case import plan, plan_sha256
from flea_diag.tools.campaign.recording_set import RecordingSet
from flea_diag.tools.evaluate.baselines import Setting, baseline
from flea_diag.tools.evaluate.case_run import diagnose, run_case
from flea_diag.tools.features.classifier import write_classifier
from flea_diag.tools.replay.replay import replay
from flea_diag.tools.replay.summary import summarise
from flea_diag.wire.records import AmbiguityGroup, Detection, Outcome, Record

ONSET_S = 3.0
LOUD = 1.3
"""m/s^2 of accelerometer 2, between a healthy stand and one whose nut is spalled."""
LEVEL = float(np.log1p(100.0 * LOUD))
# One input, no hidden layer: spall where the level is above LOUD, nominal below.
NETWORK = Perceptron(
    ("accelerometer_2_std",), ("nominal", "spall"), np.array([LEVEL]), np.ones(1),
    ((np.array([[-20.0, 20.0]]), np.zeros(2)),), "worked on paper",
)  # fmt: skip


@functools.cache
def stand(name: str) -> tuple[Record, ...]:
    """Eight seconds of the stand with its accelerometers."""
    given: dict[str, Any] = {"sensors": {"vibration": True}, "duration_s": 9.0}
    return tuple(records(**given, **(fault(name, ONSET_S, size=2.0) if name else {})))


def said(run: tuple[Record, ...]) -> list[Record]:
    stage = FeatureClassifierStage(NETWORK, {})
    out = [caused for record in run for caused in stage.handle(record)]
    return [*out, *stage.finish()]


@pytest.mark.slow
def test_a_healthy_stand_is_called_nominal_once() -> None:
    (group,) = said(stand(""))
    assert isinstance(group, AmbiguityGroup)
    assert group.outcome is Outcome.NOMINAL
    assert group.features_computed == NETWORK.features


def test_a_fault_is_called_after_three_windows_that_agree() -> None:
    _, flag, group = said(stand("spall"))
    assert isinstance(flag, Detection)
    assert isinstance(group, AmbiguityGroup)
    assert [member.fault for member in group.members] == ["spall"]
    assert group.outcome is Outcome.ISOLATED
    start_ns = stand("spall")[0].stamp_ns
    after_s = (flag.stamp_ns - start_ns) / 1e9 - ONSET_S
    assert IN_A_ROW <= after_s <= IN_A_ROW + 1.1


def test_its_price_is_that_of_all_its_features() -> None:
    stage = FeatureClassifierStage(NETWORK, {})
    told = summarise(diagnose(stand("spall"), stage).kept)
    assert told["features_computed"] == ["accelerometer_2_std"]


def test_without_vibration_it_says_that_it_cannot_see() -> None:
    told = replay(BAGS / "nominal", FeatureClassifierStage(NETWORK, {}))
    assert told["outcome"] == "NOT_OBSERVABLE"


CAMPAIGN: dict[str, Any] = {
    "schema_version": 1,
    "name": "both",
    "configurations": ["hybrid", CLASSIFIER],
    "sources": [{"kind": "recordings", "name": "kept", "files": [f"{BAGS}/jam"]}],
}


def test_a_campaign_hands_its_network_to_that_baseline_alone(tmp_path: Path) -> None:
    write_classifier(tmp_path / "network.json", NETWORK)
    campaign = campaign_from_mapping({**CAMPAIGN, "classifier": "network.json"}, "test", tmp_path)
    hybrid, ours = plan(campaign, RecordingSet(campaign, tmp_path))
    assert (hybrid.classifier, ours.classifier) == ("", str(tmp_path / "network.json"))
    stage = baseline(CLASSIFIER).make(Setting(load_stand(), classifier=Path(ours.classifier)))
    assert isinstance(stage, FeatureClassifierStage)
    elsewhere = campaign_from_mapping({**CAMPAIGN, "classifier": "/else/n.json"}, "test", tmp_path)
    moved = plan(elsewhere, RecordingSet(elsewhere, tmp_path))
    assert plan_sha256(campaign, (hybrid, ours)) == plan_sha256(elsewhere, moved)


@pytest.mark.slow
def test_limit_checks_learn_from_the_bags_that_a_campaign_names(tmp_path: Path) -> None:
    given = {**CAMPAIGN, "configurations": ["limit_checks"], "learn_from": [f"{BAGS}/nominal"]}
    campaign = campaign_from_mapping(given, "test", tmp_path)
    (case,) = plan(campaign, RecordingSet(campaign, tmp_path))
    assert case.learned_from == (str(BAGS / "nominal"),)
    result = run_case(case, {}, tmp_path)
    assert not result.failure
    assert result.outcome == "INDISTINGUISHABLE"
    assert "jam" in result.group


def test_without_a_network_it_says_how_to_make_one() -> None:
    with pytest.raises(ConfigurationError, match="flea features train"):
        baseline(CLASSIFIER).make(Setting(load_stand()))
