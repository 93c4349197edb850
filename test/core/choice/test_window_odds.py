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

"""A window says no more than its features were right on runs not learned from."""

import math

import pytest

from flea_diag.core.choice.feature_table import FaultFeatureTable
from flea_diag.core.choice.window_odds import WindowOdds
from flea_diag.errors import ConfigurationError

EQUAL = {"jam": 0.5, "spall": 0.5}
ROW = {"+": 0.9, "0": 0.1}
OTHER = {"+": 0.1, "0": 0.9}


def table(window_error: float = 0.0) -> FaultFeatureTable:
    return FaultFeatureTable.from_mapping(
        {
            "window_error": {"jam": {"spall": window_error}, "spall": {"jam": window_error}},
            "features": {"a": {"cost": 1}, "b": {"cost": 1}, "c": {"cost": 1}},
            "faults": {
                "jam": dict.fromkeys("abc", ROW),
                "spall": dict.fromkeys("abc", OTHER),
            },
        },
        "test",
    )


def odds(group: dict[str, float]) -> float:
    return group["jam"] / group["spall"] if "spall" in group else math.inf


def test_without_an_error_features_of_a_window_multiply_by_bayes() -> None:
    window, stated = WindowOdds(), table()
    group = window.after(EQUAL, stated, "a", "+")
    assert odds(group) == pytest.approx(9.0)
    assert odds(window.after(group, stated, "b", "+")) == pytest.approx(81.0)
    assert set(window.after(window.after(group, stated, "b", "+"), stated, "c", "+")) == {"jam"}


def test_however_many_features_agree_one_window_says_no_more_than_it_was_right() -> None:
    window, counted, group = WindowOdds(), table(window_error=0.05), EQUAL
    found = []
    for feature in "abc":
        group = window.after(group, counted, feature, "+")
        found.append(odds(group))
    assert found == pytest.approx([9.0, 20.0, 20.0])


def test_a_second_window_that_agrees_drops_the_fault() -> None:
    window, counted, group = WindowOdds(), table(window_error=0.05), EQUAL
    for _ in range(2):
        window.begin()
        for feature in "ab":
            group = window.after(group, counted, feature, "+")
    assert group == {"jam": 1.0}


def test_windows_that_contradict_each_other_leave_both() -> None:
    window, counted, group = WindowOdds(), table(window_error=0.05), EQUAL
    for symbol in "+0":
        window.begin()
        for feature in "ab":
            group = window.after(group, counted, feature, symbol)
    assert odds(group) == pytest.approx(1.0)


def test_a_feature_that_speaks_against_the_others_of_its_window_takes_back_what_they_said() -> None:
    window, counted, group = WindowOdds(), table(window_error=0.05), EQUAL
    for feature, symbol in (("a", "+"), ("b", "+"), ("c", "0")):
        group = window.after(group, counted, feature, symbol)
    assert odds(group) == pytest.approx(9.0)  # 81 / 9, not 20 / 9


def test_what_further_features_can_split_is_the_group_without_the_bound() -> None:
    window, counted = WindowOdds(), table(window_error=0.05)
    group = window.after(window.after(EQUAL, counted, "a", "+"), counted, "b", "+")
    assert odds(window.unbounded(group, counted)) == pytest.approx(81.0)
    group = window.after(group, counted, "c", "+")
    assert set(window.unbounded(group, counted)) == {"jam"}
    assert set(group) == {"jam", "spall"}


def test_an_answer_without_a_value_changes_nothing() -> None:
    assert WindowOdds().after(EQUAL, table(0.05), "a", "?") == EQUAL


def test_a_symbol_that_no_fault_can_give_leaves_none() -> None:
    assert WindowOdds().after(EQUAL, table(), "a", "-") == {}


def test_what_the_file_says_of_nominal_windows_holds_for_each_fault_that_acts_on_no_feature() -> (
    None
):
    content = {
        "window_error": {"nominal": {"jam": 0.02}, "jam": {"nominal": 0.03}},
        "features": {"a": {"cost": 1}},
        "faults": {"jam": {"a": ROW}},
        "unaffected": {"faults": ["bias", "drift"], "entries": {"a": OTHER}},
    }
    errors = FaultFeatureTable.from_mapping(content, "test").window_error
    assert errors == {
        ("bias", "jam"): 0.02, ("drift", "jam"): 0.02, ("jam", "bias"): 0.03, ("jam", "drift"): 0.03
    }  # fmt: skip


@pytest.mark.parametrize("errors", [{"jma": {"spall": 0.1}}, {"jam": {"spal": 0.1}}])
def test_an_error_of_a_fault_without_a_row_is_refused_by_its_name(errors) -> None:
    content = {
        "window_error": errors,
        "features": {"a": {"cost": 1}},
        "faults": {"jam": {"a": ROW}, "spall": {"a": OTHER}},
    }
    with pytest.raises(ConfigurationError, match=r"test: window_error.*(jma|spal)"):
        FaultFeatureTable.from_mapping(content, "test")
