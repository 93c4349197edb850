"""Damaged input of every kind is read or refused in one line; findings of longer runs."""

from __future__ import annotations

import copy
import random

import pytest
from support import fuzzing

from flea_diag.errors import ConfigurationError

INPUTS = 60
TARGETS = {target.name: target for target in fuzzing.targets()}


@pytest.mark.parametrize("name", TARGETS)
def test_what_is_whole_is_read(name: str) -> None:
    assert all(fuzzing.accepted(TARGETS[name], seed) for seed in TARGETS[name].seeds)


@pytest.mark.parametrize("name", TARGETS)
def test_what_is_damaged_is_read_or_refused(name: str) -> None:
    target, chance = TARGETS[name], random.Random(11)
    for _ in range(INPUTS if name != "faults" else 8):
        fuzzing.accepted(target, fuzzing.damaged(chance.choice(target.seeds), chance))


@pytest.mark.parametrize("name", ["scenario", "parameters", "calibration"])
def test_a_tree_is_read_from_its_text_as_well(name: str) -> None:
    target = fuzzing.as_text(TARGETS[name])
    assert all(fuzzing.accepted(target, seed) for seed in target.seeds)
    assert not fuzzing.accepted(target, b"{: [")


def test_a_rate_that_is_a_list_is_refused() -> None:
    (table,) = copy.deepcopy(TARGETS["feature table"].seeds)
    table["nominal"]["false_alarm_rate"] = [1.0]
    with pytest.raises(ConfigurationError, match="false_alarm_rate"):
        TARGETS["feature table"].read(table)


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
        TARGETS[name].read(content)
