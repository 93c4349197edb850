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

"""Damaged input of every kind is read or refused in one line; findings of longer runs."""

from __future__ import annotations

import copy
import random
from functools import cache

import pytest
from support import fuzzing

from flea_diag.errors import ConfigurationError

INPUTS = 60
NAMES = (
    "codec ChannelTable",
    "codec Truth",
    "codec Scan",
    "codec DataQuality",
    "codec Residual",
    "codec AmbiguityGroup",
    "codec Detection",
    "codec Symbols",
    "codec VibrationBlock",
    "codec VibrationLevel",
    "codec VerdictNumbers",
    "codec FeatureRequest",
    "codec FeatureValue",
    "codec Health",
    "scan columns",
    "bag",
    "importer",
    "yaml text",
    "scenario text",
    "stand",
    "actuator",
    "faults",
    "feature table",
    "calibration",
    "scenario",
    "campaign",
    "parameters",
    "alarm row",
    "run result",
    "replay summary",
    "run trace",
    "classifier",
)
"""Every reader, known before the first test: what they read takes seconds to make."""


@cache
def target_named(name: str) -> fuzzing.Target:
    return {target.name: target for target in fuzzing.targets()}[name]


def test_no_reader_is_left_out() -> None:
    assert tuple(target.name for target in fuzzing.targets()) == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_what_is_whole_is_read(name: str) -> None:
    assert all(fuzzing.accepted(target_named(name), seed) for seed in target_named(name).seeds)


@pytest.mark.parametrize("name", NAMES)
def test_what_is_damaged_is_read_or_refused(name: str) -> None:
    target, chance = target_named(name), random.Random(11)
    for _ in range(INPUTS if name != "faults" else 8):
        fuzzing.accepted(target, fuzzing.damaged(chance.choice(target.seeds), chance))


@pytest.mark.parametrize("name", ["scenario", "parameters", "calibration"])
def test_a_tree_is_read_from_its_text_as_well(name: str) -> None:
    target = fuzzing.as_text(target_named(name))
    assert all(fuzzing.accepted(target, seed) for seed in target.seeds)
    assert not fuzzing.accepted(target, b"{: [")


def test_a_rate_that_is_a_list_is_refused() -> None:
    (table,) = copy.deepcopy(target_named("feature table").seeds)
    table["nominal"]["false_alarm_rate"] = [1.0]
    with pytest.raises(ConfigurationError, match="false_alarm_rate"):
        target_named("feature table").read(table)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("parameters", {None: 1, "unheard_of": 2}),
        ("parameters", {"warm_up_s": 10**400}),
        ("scenario", {"duration_s": -(10**400)}),
        ("campaign", {"schema_version": 1, "name": "x", "sources": [{"kind": {}}]}),
        ("actuator", {"schema_version": 1, "name": "x", "parameters": {"r": 10**400}}),
        ("feature table", {"ranges": {"crest": 1.5}}),
    ],
)
def test_findings(name: str, content: object) -> None:
    with pytest.raises(ConfigurationError):
        target_named(name).read(content)
