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

"""Other ways to diagnose: each differs from ours in what its row says, on a recorded jam."""

from __future__ import annotations

from typing import Any

import pytest
from support.decisions import BAGS

from flea_diag.configuration.stand import load_stand
from flea_diag.core.faults.fault_signature import FaultSignature
from flea_diag.core.signatures.structural import _any_sign
from flea_diag.errors import ConfigurationError
from flea_diag.tools.campaign.campaign import CLASSIFIER
from flea_diag.tools.evaluate.baselines import BASELINES, Setting, baseline
from flea_diag.tools.replay.replay import replay

SETTING = Setting(load_stand(), (BAGS / "nominal",) * 2)


@pytest.fixture(scope="module")
def jam() -> dict[str, Any]:
    """What each makes of the same jam, with vibration in the bag."""
    return {
        name: replay(BAGS / "jam", baseline(name).make(SETTING))
        for name in BASELINES
        if name != CLASSIFIER  # of vibration the bag has one second: test_feature_classifier.py
    }


def test_each_names_a_group_that_holds_the_truth(jam: dict[str, Any]) -> None:
    """All but the evidence, whose law of one recording does not know this unit."""
    others = {name: told for name, told in jam.items() if name != "evidence"}
    assert all("jam" in told["ambiguity_group"] for told in others.values())


def test_without_vibration_no_feature_is_computed(jam: dict[str, Any]) -> None:
    assert jam["hybrid"]["features_computed"]
    assert jam["hybrid"]["ambiguity_group"] == ["jam"]
    assert jam["without_vibration"]["features_computed"] == []
    assert set(jam["without_vibration"]["ambiguity_group"]) == {"ball_nut_friction", "jam"}


def test_likelihoods_shrink_the_group_and_spare_features(jam: dict[str, Any]) -> None:
    hybrid, without = jam["hybrid"], jam["without_likelihood"]
    assert set(hybrid["ambiguity_group"]) <= set(without["ambiguity_group"])
    assert len(hybrid["features_computed"]) < len(without["features_computed"])


def test_signs_shrink_the_group(jam: dict[str, Any]) -> None:
    structural = set(jam["structural"]["ambiguity_group"])
    assert set(jam["without_likelihood"]["ambiguity_group"]) <= structural | {"spall"}
    assert len(structural) > len(jam["without_likelihood"]["ambiguity_group"])


def test_the_literal_tree_cannot_split_what_table_3_holds_alike(jam: dict[str, Any]) -> None:
    assert {"jam", "ball_nut_friction"} <= set(jam["paper"]["ambiguity_group"])


@pytest.mark.parametrize(
    ("cell", "symbols"),
    [
        (FaultSignature("0", "-", 1, "path"), "**"),
        (FaultSignature("+", "0", 0, "path"), "**"),
        (FaultSignature("0", "0", -1, ""), "00"),
    ],
)
def test_a_table_without_signs_keeps_what_is_connected(cell: FaultSignature, symbols: str) -> None:
    assert _any_sign(cell).symbols == symbols
    assert (_any_sign(cell).order, _any_sign(cell).path) == (cell.order, cell.path)


@pytest.mark.parametrize("name", ["limit_checks"])
def test_what_learns_from_nominal_bags_is_refused_without(name: str) -> None:
    with pytest.raises(ConfigurationError, match=r"need .*nominal bags.* to learn"):
        baseline(name).make(Setting(load_stand()))


def test_a_name_that_is_not_in_the_table_is_refused_with_those_that_are() -> None:
    with pytest.raises(ConfigurationError, match=r"'guessing'.*hybrid.*structural"):
        baseline("guessing")
