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

"""Fault feature tables and nominal ranges: what they say, and what they refuse."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from flea_diag.configuration.files import config_path
from flea_diag.core.choice.feature_table import FaultFeatureTable
from flea_diag.core.vibration.features import FeatureId
from flea_diag.core.vibration.nominal_range import (
    NominalRange,
    VibrationOperatingPoint,
    learn_nominal,
)
from flea_diag.errors import CalibrationError, ConfigurationError
from flea_diag.fields.reader import read_as
from flea_diag.fields.values import FINITE

TABLES = {name: yaml.safe_load(config_path(name).read_text()) for name in
          ("feature_table_paper.yaml", "feature_table.yaml")}  # fmt: skip


def table(name: str) -> FaultFeatureTable:
    return FaultFeatureTable.from_mapping(TABLES[name], name)


def test_paper_table_is_table_3_and_can_split_no_more_than_it_says() -> None:
    found = table("feature_table_paper.yaml")
    assert [found.value(f, "accelerometer_1_std") for f in found.faults] == list("00011010")
    assert [found.value(f, "accelerometer_2_std") for f in found.faults] == list("11110110")
    groups = {frozenset(group) for group in found.inseparable(found.faults)}
    assert groups == {
        frozenset({"spall", "jam", "ball_nut_friction", "accelerometer_2_fault"}),
        frozenset({"rotor_eccentricity", "backlash"}),
        frozenset({"accelerometer_1_fault"}),
        frozenset({"winding_short"}),
    }


def test_shipped_table_splits_every_pair_of_the_papers_faults_but_unaffected_ones() -> None:
    paper, shipped = table("feature_table_paper.yaml"), table("feature_table.yaml")
    assert all(len(group) == 1 for group in shipped.inseparable(paper.faults))
    assert set(shipped.nominal.ranges) == set(shipped.features)
    assert len(shipped.nominal.levels) == len(shipped.nominal.resting_levels) == 6
    assert len(shipped.nominal.kurtosis) == 6
    for feature in shipped.features:
        FeatureId.parse(feature)
    for fault in shipped.faults:
        for feature in shipped.features:
            assert sum(shipped.probabilities(fault, feature)) == pytest.approx(1.0)
            assert shipped.provenance[fault, feature]


def test_unknown_fault_is_neither_favoured_nor_dropped() -> None:
    found = table("feature_table_paper.yaml")
    assert found.probabilities("load_force_bias", "accelerometer_1_std") == (0.5, 0.5)
    assert found.value("load_force_bias", "accelerometer_1_std") == "?"


@pytest.mark.parametrize(
    ("alphabet", "symbol", "place"),
    [
        (["0", "1"], "+", 1), (["0", "1"], "--", 1), (["0", "1"], "0", 0),
        (["-", "0", "+"], "++", 2), (["-", "0", "+"], "--", 0),
        (["--", "-", "0", "+", "++"], "++", 4), (["--", "-", "0", "+", "++"], "+", 3),
        (["0", "1"], "0^", 0), (["--", "-", "0", "+", "++"], "0^", 2),
        (["--", "-", "0", "0^", "+", "++"], "0^", 3),
    ],
)  # fmt: skip
def test_coarser_tables_read_finer_symbols(alphabet: list[str], symbol: str, place: int) -> None:
    mapping = {"alphabet": alphabet, "features": {"f": {"cost": 1}}, "faults": {"a": {"f": "0"}}}
    assert FaultFeatureTable.from_mapping(mapping, "t").place(symbol) == place


def test_confidence_is_shared_out_and_entries_may_say_more() -> None:
    mapping: dict[str, Any] = {
        "confidence": 0.9,
        "features": {"f": {"cost": 1}, "g": {"cost": 2}},
        "faults": {"a": {"f": "+", "source": "bench"}, "b": {"f": {"-": 0.25, "0": 0.75}}},
        "unaffected": {"faults": ["c", "d"], "source": "assumed", "entries": {"g": "0"}},
    }
    found = FaultFeatureTable.from_mapping(mapping, "t")
    assert found.probabilities("a", "f") == pytest.approx((0.05, 0.05, 0.9))
    assert found.probabilities("b", "f") == (0.25, 0.75, 0.0)
    assert found.value("d", "g") == "0"
    assert found.provenance["a", "f"] == "bench"
    assert found.provenance["c", "g"] == "assumed"


def test_a_feature_that_is_not_asked_for_has_entries_for_alarms_alone() -> None:
    mapping: dict[str, Any] = {
        "features": {"f": {"cost": 1}, "g": {"cost": 2, "asked": False}},
        "faults": {"a": {"f": "0", "g": "+"}, "b": {"f": "0", "g": "0"}},
    }
    found = FaultFeatureTable.from_mapping(mapping, "t")
    assert found.features == ("f",)
    assert found.probabilities("a", "g") == (0.0, 0.0, 1.0)
    assert found.inseparable(["a", "b"]) == (("a", "b"),)
    shipped = table("feature_table.yaml")
    assert "accelerometer_2_kurtosis" not in shipped.features
    assert sum(shipped.probabilities("spall", "accelerometer_2_kurtosis")[3:]) > 0.95


RANGE = {"coefficients": [0], "low": -1, "high": 1}
GOOD: dict[str, Any] = {"features": {"f": {"cost": 1}}, "faults": {"a": {"f": "0"}}}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"colour": 1}, "unknown key 'colour'"),
        ({"alphabet": ["a", "b"]}, "alphabet"),
        ({"faults": {}}, "faults is empty; give at least one"),
        ({"features": {"f": {"cost": 0}}}, "f: cost = 0.0 is below its limit 0.001"),
        ({"features": {"f": {"cost": True}}}, "cost = True"),
        ({"features": {"f": {"price": 1}}}, "unknown key 'price'"),
        ({"features": {"f": {"cost": 1, "asked": "no"}}}, "f: asked = 'no' must be true or false"),
        ({"faults": {"a": {"g": "0"}}}, "a: unknown key 'g'"),
        ({"faults": {"a": {"f": "up"}}}, "a, f: 'up' is not one of"),
        ({"faults": {"a": {"f": {"0": 0.5}}}}, "sum to 0.5"),
        ({"faults": {"a": {"f": {"0": 2}}}}, "a, f: '0' = 2.0 is above its limit 1.0"),
        ({"faults": {"a": 3}}, "a = 3 must be a mapping"),
        ({"unaffected": {"faults": "c"}}, "faults = 'c' must be a list"),
        ({"nominal": {"ranges": {"g": RANGE}}}, "ranges: unknown key 'g'"),
        ({"nominal": {"ranges": {"f": {"low": 1}}}}, "ranges: f: coefficients is missing"),
        ({"nominal": {"ranges": {"f": {"coefficients": [0], "low": 1, "high": 0}}}}, "below high"),
        (
            {"nominal": {"ranges": {"f": {"coefficients": [0], "low": -1, "high": 1, "upper": 2}}}},
            "f: upper = 2.0 is above its limit 1.0",
        ),
        ({"nominal": {"orders": {"nut": -1}}}, "orders: nut = -1.0 is below its limit"),
    ],
)
def test_bad_table_is_refused_by_name(change: dict[str, Any], words: str) -> None:
    with pytest.raises(ConfigurationError) as refusal:
        FaultFeatureTable.from_mapping({**GOOD, **change}, "t.yaml")
    assert words in str(refusal.value)
    assert str(refusal.value).startswith("t.yaml")


@pytest.mark.parametrize("content", ["hello " * 10_000, [1], None])
def test_what_is_no_table_at_all_is_said_to_be_none(content: Any) -> None:
    with pytest.raises(
        ConfigurationError, match=r"^t.yaml: feature table must be a mapping, not .{1,80}$"
    ):
        FaultFeatureTable.from_mapping(content, "t.yaml")


# --- nominal ranges ------------------------------------------------------------------------


@pytest.mark.parametrize("rate", [0.02, 0.1])
@pytest.mark.parametrize("kind", ["normal", "exponential", "uniform"])
def test_false_alarm_rate_holds_for_any_distribution(rate: float, kind: str) -> None:
    draw = np.random.default_rng(5)
    make = {"normal": draw.normal, "exponential": draw.exponential, "uniform": draw.uniform}[kind]
    shares = []
    for _ in range(40):
        found = learn_nominal(make(size=300), rate)
        symbols = [found.symbol(value, VibrationOperatingPoint()) for value in make(size=200)]
        shares.append(np.mean([symbol != "0" for symbol in symbols]))
    # 40 x 200 draws of the share: its standard error is below a fifth of the rate.
    assert np.mean(shares) == pytest.approx(rate, rel=0.35)


def test_few_values_are_extrapolated_beyond_their_extremes() -> None:
    values = np.random.default_rng(2).normal(size=30)
    low, high = learn_nominal(values, 0.001).at(VibrationOperatingPoint())
    assert low < values.min()
    assert high > values.max()


def test_range_follows_the_operating_point() -> None:
    draw = np.random.default_rng(3)
    points = [VibrationOperatingPoint(w, f) for w, f in draw.uniform([0, 0], [150, 300], (400, 2))]
    values = [(0.1 + p.speed_rad_s / 100.0) * math.exp(0.05 * draw.normal()) for p in points]
    found = learn_nominal(values, 0.02, points, logarithmic=True)
    for speed in (5.0, 40.0, 140.0):
        low, high = found.at(VibrationOperatingPoint(speed, 100.0))
        assert low < 0.1 + speed / 100.0 < high
        assert high / low < 1.5
    assert found.symbol(1.0, VibrationOperatingPoint(20.0, 100.0)) == "+"
    assert found.symbol(1.0, VibrationOperatingPoint(90.0, 100.0)) == "0"
    assert found.symbol(0.0, VibrationOperatingPoint(90.0, 100.0)) == "-"
    # Outside of what was seen the nearest end counts; an unknown point is not guessed at.
    assert found.at(VibrationOperatingPoint(900.0, 100.0)) == found.at(
        VibrationOperatingPoint(found.speed_rad_s[1], 100.0)
    )
    assert found.symbol(1.0, VibrationOperatingPoint()) == "?"
    assert math.isfinite(found.at(VibrationOperatingPoint(90.0))[0])


def test_symbols_tell_little_from_much() -> None:
    found = NominalRange((10.0,), -1.0, 1.0, much=(3.0, 5.0))
    values = [6.9, 7.1, 8.9, 9.1, 10.9, 11.1, 14.9, 15.1, math.nan]
    assert [found.symbol(v, VibrationOperatingPoint()) for v in values] == [
        "--", "-", "-", "0", "0", "+", "+", "++", "?",
    ]  # fmt: skip


def test_the_upper_part_of_the_range_has_a_symbol_of_its_own() -> None:
    found = NominalRange((10.0,), -1.0, 1.0, upper=0.4)
    values = [8.9, 9.1, 10.3, 10.5, 10.9, 11.1]
    assert [found.symbol(v, VibrationOperatingPoint()) for v in values] == [
        "-",
        "0",
        "0",
        "0^",
        "0^",
        "+",
    ]


@given(
    st.floats(-5, 5),
    st.floats(0.01, 5),
    st.booleans(),
    st.floats(1, 20),
    st.floats(0, 100),
    st.floats(-1, 1),
)
def test_range_survives_yaml(
    centre: float, half: float, logarithmic: bool, much: float, speed: float, upper: float
) -> None:
    coefficients, ends = (centre, 0.1, 0.2, 0.0), (much, much)
    found = NominalRange(
        coefficients, -half, half, logarithmic, 7, (0.0, speed), much=ends, upper=upper
    )
    text = yaml.safe_dump(found.as_mapping())
    assert read_as(NominalRange, yaml.safe_load(text), "here", magnitudes=FINITE) == found


@pytest.mark.parametrize(
    ("values", "logarithmic", "words"),
    [
        (np.ones(5), False, "5 nominal values"),
        (np.full(50, math.nan), False, "0 nominal values"),
        (np.ones(50), False, "all nominal values are"),
        (np.linspace(-1.0, 1.0, 50), True, "has no logarithm"),
    ],
)
def test_useless_values_make_no_range(values: np.ndarray, logarithmic: bool, words: str) -> None:
    with pytest.raises(CalibrationError, match=words):
        learn_nominal(values, 0.01, logarithmic=logarithmic)
