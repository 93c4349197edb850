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

"""Metrics of the diagnosis competitions: check values, and runs worked by hand."""

from __future__ import annotations

from dataclasses import replace

import pytest

from flea_diag.tools.campaign.campaign import campaign_from_mapping
from flea_diag.tools.campaign.run_result import RunResult
from flea_diag.tools.score.score import (
    NONE,
    candidates,
    classification_errors,
    component_of,
    component_right,
    confusion,
    false_alarm_rate,
    once,
    scores,
    utility,
)
from flea_diag.tools.score.severity import ladder
from flea_diag.tools.score.summary import summarise, tables

A, B = frozenset(("a",)), frozenset(("b",))
NOMINAL = RunResult("s/n/1", "simulated", "Nominal", outcome="NOMINAL", nominal_s=1800.0,
                    duration_s=1800.0, cpu_s=2.0)  # fmt: skip
JAM = RunResult("s/j/1", "simulated", "Jam", truth="jam", onset_s=10.0, expected=("jam",),
                outcome="ISOLATED", group=("jam",), probabilities=(1.0,), alarms_s=(10.5,),
                detection_time_s=0.5, isolation_time_s=2.0, nominal_s=10.0, duration_s=40.0,
                cpu_s=1.0, size=1.0)  # fmt: skip
MISSED = replace(
    JAM, id="s/j/2", outcome="NOMINAL", group=(), probabilities=(), alarms_s=(), size=0.1,
    detection_time_s=None, isolation_time_s=None,
)  # fmt: skip
EARLY = replace(JAM, id="s/j/3", alarms_s=(4.0, 11.5), false_alarms=1, detection_time_s=1.5)
SPLIT = replace(
    JAM, id="s/j/4", group=("jam", "spall"), probabilities=(0.75, 0.25), outcome="INDISTINGUISHABLE"
)
ALL = (NOMINAL, JAM, MISSED, EARLY, SPLIT)


def test_an_exact_diagnosis_is_worth_one() -> None:
    assert utility(((A, 1.0),), A, 20) == 1.0
    assert utility(((NONE, 1.0),), NONE, 20) == 1.0


def test_no_answer_to_a_single_fault_is_worth_0_475() -> None:
    assert utility(((NONE, 1.0),), A, 20) == pytest.approx(0.475)


def test_blaming_another_costs_both_ways() -> None:
    # missed 1 of 19 held healthy: 20/40; blamed 1 of 1 held faulty: 2/40.
    assert utility(((B, 1.0),), A, 20) == pytest.approx(1.0 - 0.5 - 0.05)
    # a false alarm on a healthy system: 2/40.
    assert utility(((B, 1.0),), NONE, 20) == pytest.approx(0.95)


def test_errors_are_weighted_differences() -> None:
    assert classification_errors(((A, 1.0),), A) == 0.0
    assert classification_errors(((B, 1.0),), A) == 2.0
    assert classification_errors(((A, 0.75), (B, 0.25)), A) == 0.5
    assert classification_errors(((NONE, 1.0),), A) == 1.0


def test_weights_sum_to_one() -> None:
    for result in (SPLIT, replace(SPLIT, probabilities=(0.3, 0.1)), MISSED):
        assert sum(weight for _, weight in candidates(result)) == pytest.approx(1.0)
    assert dict(candidates(replace(SPLIT, probabilities=(0.0, 0.0)))) == {
        frozenset(("jam",)): 0.5,
        frozenset(("spall",)): 0.5,
    }


def test_the_table_of_five_runs() -> None:
    found = scores(ALL)
    assert found["right"]["right"] == 2
    assert found["right"]["count"] == 5
    assert found["false_positives"]["right"] == 1
    assert found["false_negatives"] | {"low_percent": 0, "high_percent": 0} == {
        "right": 1, "count": 4, "percent": 25.0, "low_percent": 0, "high_percent": 0,
    }  # fmt: skip
    assert found["detection_accuracy"]["percent"] == 60.0
    assert found["detection_time_s"] == {"mean": 0.8333, "median": 0.5, "worst": 1.5}
    assert found["classification_errors"] == pytest.approx(1.0 + 0.5)
    assert found["group_size"] == pytest.approx(4 / 3, rel=1e-3)
    assert found["times_real_time"] == pytest.approx((1800 + 160) / 6, rel=1e-3)


def test_false_alarms_count_against_the_time_without_a_fault() -> None:
    rate = false_alarm_rate(ALL)
    assert rate["alarms"] == 1
    assert rate["hours"] == pytest.approx(1840 / 3600, rel=1e-3)
    assert rate["low"] < rate["per_hour"] < rate["high"]


def test_a_run_with_two_folds_counts_once_and_by_its_worst() -> None:
    a, b = replace(JAM, fold="A"), replace(MISSED, id=JAM.id, fold="B")
    assert once((a, b)) == (b,)
    assert once((b, a)) == (b,)


def test_the_component_may_be_right_where_the_mode_is_not() -> None:
    assert component_of("motor_current_bias") == component_of("motor_current_dead")
    assert component_of("motor_current_bias") != component_of("motor_temperature_bias")
    wrong_mode = replace(
        JAM, truth="motor_current_bias", expected=("motor_current_bias",),
        group=("motor_current_scaling",),
    )  # fmt: skip
    assert not wrong_mode.right
    assert component_right(wrong_mode)
    assert not component_right(replace(wrong_mode, group=("motor_current_scaling", "jam")))


def test_components_are_those_of_the_stand_of_the_run() -> None:
    other = replace(
        JAM, truth="surface_angle_bias", expected=("surface_angle_bias",),
        group=("surface_angle_dead",), stand="wing",
    )  # fmt: skip
    assert component_right(other)
    # The FLEA has no such sensor, and of a stand that is gone nothing is known.
    assert not component_right(replace(other, stand=""))
    assert not component_right(replace(other, stand="/nowhere/mine"))


def test_the_confusion_names_what_was_said_first() -> None:
    assert confusion(ALL) == {"jam": {"jam": 3, "nominal": 1}, "nominal": {"nominal": 1}}


def test_a_ladder_says_where_half_of_the_runs_are_right() -> None:
    found = ladder((JAM, MISSED))
    assert found is not None
    assert [(step["size"], step["right"]) for step in found["steps"]] == [(0.1, 0), (1.0, 1)]
    assert found["half_at"] == pytest.approx(0.55)
    assert ladder((JAM,)) is None
    scaled = replace(JAM, truth="motor_current_scaling", size=0.8)
    steps = ladder((scaled, replace(scaled, id="s/j/9", size=1.2), MISSED))
    assert steps is not None
    assert [step["size"] for step in steps["steps"]] == [0.1, 0.2]


def test_a_summary_never_adds_real_and_simulated_up() -> None:
    campaign = campaign_from_mapping(
        {"schema_version": 1, "name": "x", "limit_percent": 60.0,
         "sources": [{"kind": "recordings", "files": "x"}]}, "x",
    )  # fmt: skip
    real = tuple(replace(r, kind="real", id=r.id.replace("s/", "r/")) for r in ALL)
    summary = summarise(campaign, (*ALL, *real, replace(JAM, id="s/j/5", failure="no scan")))
    assert [(part["kind"], part["scores"]["runs"]) for part in summary["parts"]] == [
        ("real", 5),
        ("simulated", 5),
    ]
    assert summary["failed"] == 1
    assert [(row["source"], row["row"]) for row in summary["lost_rows"]] == [
        ("r", "Jam"),
        ("s", "Jam"),
    ]
    jam = summary["parts"][1]["rows"][1]
    assert (jam["right"], jam["count"], jam["paper"]["percent"]) == (1, 5, 66.67)
    reasons = {row["id"]: row["why"] for row in summary["parts"][1]["not_right"]}
    assert reasons == {
        "s/j/2": "not detected",
        "s/j/3": "false alarm",
        "s/j/4": "group too large",
        "s/j/5": "failed",
    }
    assert "below the limit: s, Jam" in tables(summary)


def test_a_group_that_nothing_splits_by_design_is_counted_apart_and_is_not_right() -> None:
    words = "one of jam, spall: cannot be split without motor_voltage, by design"
    designed = replace(SPLIT, id="s/j/5", words=words)
    assert designed.by_design
    assert not designed.right
    assert not SPLIT.by_design
    assert not replace(JAM, words=words).by_design  # right as it is
    assert not replace(designed, truth="backlash").by_design
    assert not replace(designed, false_alarms=1).by_design
    campaign = campaign_from_mapping(
        {"schema_version": 1, "name": "c", "sources": [{"kind": "recordings", "files": "x"}]},
        "c.yaml",
    )
    (row,) = summarise(campaign, (JAM, SPLIT, designed))["parts"][0]["rows"]
    assert (row["right"], row["count"], row["by_design"]) == (1, 3, 1)


def test_what_the_verdict_says_it_cannot_show_is_counted_apart() -> None:
    unseen = replace(MISSED, not_observable=("jam",))
    found = scores((NOMINAL, JAM, unseen))
    assert (found["right"]["right"], found["right"]["count"]) == (2, 2)
    assert (found["unseen"]["right"], found["unseen"]["count"]) == (1, 2)
    assert found["false_negatives"]["count"] == 1
    assert found["detection_accuracy"]["percent"] == 100.0
    # One that raised an alarm all the same is judged by it, and one expected to be silent is right.
    assert not replace(unseen, alarms_s=(12.0,)).unseen
    assert not replace(unseen, expected=()).unseen
    campaign = campaign_from_mapping(
        {"schema_version": 1, "name": "c", "limit_percent": 100.0,
         "sources": [{"kind": "recordings", "files": "x"}]}, "c.yaml"
    )  # fmt: skip
    summary = summarise(campaign, (unseen,))
    assert summary["lost_rows"] == []
    assert summary["parts"][0]["not_right"] == []
    assert "1 listed as not observable" in tables(summary)


def test_a_summary_says_when_from_what_and_by_which_seed_it_was_made() -> None:
    drawn = {"kind": "drawn", "name": "s", "seed": 7, "rows": [{"title": "Jam", "fault": "jam"}]}
    recorded = {"kind": "recordings", "name": "r", "files": "x"}
    campaign = campaign_from_mapping(
        {"schema_version": 1, "name": "c", "sources": [drawn, recorded]}, "c.yaml"
    )
    runs = (
        replace(JAM, date="2026-11-22", commit="123456789"),
        replace(MISSED, date="2026-11-21", commit="123456789"),
        replace(NOMINAL, id="r/n/1", kind="real"),  # of a version that noted neither
    )
    summary = summarise(campaign, runs)
    assert summary["schema_version"] == 2
    assert summary["dates"] == ["2026-11-21", "2026-11-22"]
    assert summary["commits"] == ["123456789"]
    assert {part["source"]: part["seed"] for part in summary["parts"]} == {"s": 7, "r": None}
