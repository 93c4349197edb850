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

"""Choosing features and the diagnosis tree: worked tables, and properties of any table."""

from __future__ import annotations

import math
import time
from dataclasses import replace

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from support import examples

from flea_diag.configuration.knowledge import load_features
from flea_diag.core.choice.diagnosis_tree import Node, asked_tree, build, follow, leaves, render
from flea_diag.core.choice.fault_group import entropy, normalised, outcomes, refine, refine_side
from flea_diag.core.choice.feature_choice import STRATEGIES, FeatureChooser, Rules, next_feature
from flea_diag.core.choice.feature_question import RAREST, Question
from flea_diag.core.choice.feature_table import FaultFeatureTable
from flea_diag.errors import ConfigurationError

COLUMNS = dict(zip(
    ("std_1", "std_2", "rest_1", "rest_2", "kurtosis_2", "reversal_1", "envelope", "order_1"),
    (1.0, 1.0, 2.0, 2.0, 3.0, 3.0, 40.0, 8.0), strict=True,
))  # fmt: skip
ROWS = {
    "spall": "++--+0+0", "jam": "0+0-+000", "ball_nut_friction": "0+0--000",
    "rotor_eccentricity": "++-0000+", "backlash": "++++0+00", "accelerometer_1_noise": "+0+00+00",
    "accelerometer_2_noise": "0+0+-000", "accelerometer_1_dead": "-0+00+0-",
    "accelerometer_2_dead": "0-0+-000", "winding_short": "00000000",
}  # fmt: skip
DRAG = ("spall", "jam", "ball_nut_friction")
SEVEN = (*DRAG, "accelerometer_2_noise", "accelerometer_2_dead", "backlash", "rotor_eccentricity")
EXACT = Rules(rarest=0.0, horizon=0.0, most_states=200_000, digits=12)


def made(
    costs: dict[str, float], rows: dict[str, str], confidence: float = 1.0
) -> FaultFeatureTable:
    return FaultFeatureTable.from_mapping(
        {
            "confidence": confidence,
            "features": {name: {"cost": cost} for name, cost in costs.items()},
            "faults": {
                fault: dict(zip(costs, symbols, strict=True)) for fault, symbols in rows.items()
            },
        },
        "test",
    )


WORKED = made(COLUMNS, ROWS)


def cost(group: tuple[str, ...], strategy: str) -> float:
    chooser = FeatureChooser(WORKED, strategy, EXACT)
    return build(dict.fromkeys(group, 1.0), chooser).expected_cost


@pytest.mark.parametrize(
    ("group", "strategy", "expected"),
    [
        (DRAG, "balanced", 3.0), (DRAG, "information", 3.0), (DRAG, "optimal", 3.0),
        (SEVEN, "paper", 6.0), (SEVEN, "information", 4.14), (SEVEN, "optimal", 4.00),
        (tuple(ROWS), "balanced", 5.0), (tuple(ROWS), "information", 3.70),
        (tuple(ROWS), "optimal", 3.60),
    ],
)  # fmt: skip
def test_expected_costs_of_the_worked_table(
    group: tuple[str, ...], strategy: str, expected: float
) -> None:
    assert cost(group, strategy) == pytest.approx(expected, abs=0.005)


def test_literal_rule_prefers_a_feature_that_splits_nothing() -> None:
    """One part has difference 0 and beats the 2 | 1 of the feature that does split."""
    table = made({"std_1": 1.0, "std_2": 1.0}, {"spall": "0+", "jam": "0+", "backlash": "++"})
    group = {"spall": 1.0, "jam": 1.0, "backlash": 1.0}
    assert next_feature(group, table, strategy="paper") == "std_2"
    for strategy in ("balanced", "information", "optimal"):
        assert next_feature(group, table, strategy=strategy) == "std_1"
    assert cost(DRAG, "paper") > 5.0 * cost(DRAG, "optimal")


def test_nothing_is_computed_for_a_group_that_cannot_be_split() -> None:
    table = made({"a": 1.0}, {"x": "+", "y": "+"})
    for strategy in ("balanced", "information", "optimal"):
        assert next_feature({"x": 1.0, "y": 1.0}, table, strategy=strategy) is None
    assert next_feature({"x": 1.0}, table) is None
    assert next_feature({}, table) is None


def test_computed_features_are_not_chosen_and_those_at_hand_cost_nothing() -> None:
    group = dict.fromkeys(DRAG, 1.0)
    assert next_feature(group, WORKED, ("std_1",)) != "std_1"
    chooser = FeatureChooser(WORKED)
    assert chooser.next(group, at_hand=("envelope",)) == "envelope"
    assert chooser.next(group) != "envelope"


def test_unknown_strategy_is_refused_by_name() -> None:
    with pytest.raises(ConfigurationError, match=r"'best'.*optimal"):
        FeatureChooser(WORKED, "best")


# --- Bayes ---------------------------------------------------------------------------------

NOISY = FaultFeatureTable.from_mapping(
    {
        "features": {"f": {"cost": 1}, "g": {"cost": 2}},
        "faults": {
            "jam": {"f": {"0": 0.2, "+": 0.8}, "g": {"0": 0.9, "+": 0.1}},
            "spall": {"f": {"0": 0.6, "+": 0.4}, "g": {"0": 0.1, "+": 0.9}},
        },
    },
    "noisy",
)


def test_a_side_is_worth_as_much_as_all_its_symbols_together() -> None:
    """3/8 + 1/8 against 1/8 + 0: four to one."""
    rows = {
        "jam": {"f": {"0": 0.5, "+": 0.375, "++": 0.125}},
        "spall": {"f": {"--": 0.125, "0": 0.75, "+": 0.125}},
    }
    table = FaultFeatureTable.from_mapping(
        {"alphabet": ["--", "-", "0", "+", "++"], "features": {"f": {"cost": 1}}, "faults": rows},
        "test",
    )
    even = {"jam": 0.5, "spall": 0.5}
    assert refine_side(even, table, "f", "+") == pytest.approx({"jam": 0.8, "spall": 0.2})
    assert refine_side(even, table, "f", "-") == {"spall": 1.0}


def test_refine_is_bayes_worked_on_paper() -> None:
    left = refine({"jam": 0.5, "spall": 0.5}, NOISY, "f", "+")
    assert left == pytest.approx({"jam": 2 / 3, "spall": 1 / 3})
    left = refine(left, NOISY, "g", "0")
    assert left == pytest.approx({"jam": 18 / 19, "spall": 1 / 19})
    assert refine(left, NOISY, "g", "0", drop_below=0.05) == {"jam": 1.0}


def test_unknown_answer_changes_nothing_and_impossible_one_empties_the_group() -> None:
    assert refine({"jam": 1.0, "spall": 1.0}, NOISY, "f", "?") == {"jam": 0.5, "spall": 0.5}
    assert refine({"jam": 0.5, "spall": 0.5}, NOISY, "f", "-") == {}


def test_entropy_of_equal_members() -> None:
    assert entropy(dict.fromkeys("abcd", 1.0)) == pytest.approx(2.0)


# --- properties of any table ------------------------------------------------------------------

FAULTS = ["a", "b", "c", "d", "e"]


@st.composite
def hard_tables(draw: st.DrawFn) -> FaultFeatureTable:
    count = draw(st.integers(1, 5))
    costs = {f"f{k}": draw(st.sampled_from([1.0, 2.0, 3.0, 7.0])) for k in range(count)}
    symbols = st.text(alphabet="-0+", min_size=count, max_size=count)
    return made(costs, {fault: draw(symbols) for fault in FAULTS})


@st.composite
def noisy_tables(draw: st.DrawFn) -> FaultFeatureTable:
    table = draw(hard_tables())
    rows = {f: "".join(table.value(f, g) for g in table.costs) for f in FAULTS}
    return made(dict(table.costs), rows, draw(st.sampled_from([0.7, 0.9, 0.97])))


groups = st.dictionaries(st.sampled_from(FAULTS), st.floats(0.05, 1.0), min_size=1)


def tree(table: FaultFeatureTable, group: dict[str, float], strategy: str) -> Node:
    return build(group, FeatureChooser(table, strategy, EXACT))


@pytest.mark.slow
@settings(max_examples=examples(150), deadline=None)
@given(hard_tables(), groups)
def test_optimum_never_costs_more_and_all_strategies_have_the_same_leaves(
    table: FaultFeatureTable, group: dict[str, float]
) -> None:
    trees = {strategy: tree(table, group, strategy) for strategy in STRATEGIES}
    parts = {name: {leaf.faults for leaf in leaves(root)} for name, root in trees.items()}
    sets = {name: {frozenset(leaf) for leaf in found} for name, found in parts.items()}
    for name, root in trees.items():
        assert trees["optimal"].expected_cost <= root.expected_cost + 1e-9
        assert sets[name] == {frozenset(part) for part in table.inseparable(group)}


@pytest.mark.slow
@settings(max_examples=examples(60), deadline=None)
@given(noisy_tables(), groups)
def test_optimum_never_costs_more_on_noisy_tables(
    table: FaultFeatureTable, group: dict[str, float]
) -> None:
    best = tree(table, group, "optimal").expected_cost
    for strategy in ("balanced", "information"):
        assert best <= tree(table, group, strategy).expected_cost + 1e-9


@settings(max_examples=examples(100), deadline=None)
@given(noisy_tables(), groups, st.lists(st.sampled_from(["--", "-", "0", "+", "++", "?"])))
def test_groups_only_shrink(
    table: FaultFeatureTable, group: dict[str, float], answers: list[str]
) -> None:
    left = normalised(group)
    for feature, symbol in zip(table.features, answers, strict=False):
        smaller = refine(left, table, feature, symbol)
        assert set(smaller) <= set(left)
        assert not smaller or math.isclose(sum(smaller.values()), 1.0)
        left = smaller


@settings(max_examples=examples(60), deadline=None)
@given(hard_tables(), groups, st.sampled_from(STRATEGIES), st.sampled_from(FAULTS))
def test_lazy_walk_ends_in_a_leaf_of_the_whole_tree(
    table: FaultFeatureTable, group: dict[str, float], strategy: str, truth: str
) -> None:
    assume(truth in group)
    chooser = FeatureChooser(table, strategy, EXACT)
    left, asked = follow(group, chooser, lambda feature: table.value(truth, feature))
    assert truth in left
    assert frozenset(left) in {frozenset(leaf.faults) for leaf in leaves(build(group, chooser))}
    assert len(set(asked)) == len(asked)


def test_walk_goes_on_past_a_feature_that_cannot_be_computed() -> None:
    table = made({"a": 1.0, "b": 2.0}, {"x": "++", "y": "00"})
    left, asked = follow(
        {"x": 1.0, "y": 1.0}, FeatureChooser(table), lambda name: "?" if name == "a" else "+"
    )
    assert (set(left), asked) == ({"x"}, ("a", "b"))


def test_choice_depends_on_the_question_alone() -> None:
    used, fresh = FeatureChooser(NOISY), FeatureChooser(NOISY)
    used.next({"jam": 0.9, "spall": 0.1})
    question = {"jam": 0.5, "spall": 0.5}
    assert used.next(question) == fresh.next(question)


def test_tree_is_drawn() -> None:
    table = made({"std_1": 1.0}, {"spall": "+", "jam": "0", "ball_nut_friction": "0"})
    text = render(build(dict.fromkeys(DRAG, 1.0), FeatureChooser(table)))
    assert text.splitlines() == [
        "std_1?   expected cost 1",
        "├─ 0 (67%)  {ball_nut_friction, jam}",
        "└─ + (33%)  {spall}",
    ]


def shipped_table(features: int) -> FaultFeatureTable:
    """The first features of the table that is shipped: whole trees of all of them are huge."""
    table = load_features("feature_table.yaml")
    return replace(table, costs=dict(list(table.costs.items())[:features]))


@pytest.mark.parametrize("states", [30, 2000])
def test_cut_off_search_costs_no_more_than_gain_per_cost(states: int) -> None:
    shipped = shipped_table(5)
    group = {"jam": 0.5, "ball_nut_friction": 0.3, "accelerometer_2_fault": 0.2}
    cut = FeatureChooser(shipped, rules=Rules(most_states=states))
    greedy = build(group, FeatureChooser(shipped, "information")).expected_cost
    assert build(group, cut).expected_cost <= greedy + 1e-9


def test_search_for_the_optimum_is_bounded() -> None:
    """Twelve noisy features and ten faults: the search ends by its limit, with an answer."""
    costs = {f"f{k}": 1.0 + k for k in range(12)}
    rows = {
        f"fault_{n}": "".join("-0+"[(n * (k + 2) + k * k) % 3] for k in range(12))
        for n in range(10)
    }
    chooser = FeatureChooser(made(costs, rows, 0.8))
    begin = time.process_time()
    assert chooser.next(dict.fromkeys(rows, 1.0)) in costs
    assert time.process_time() - begin < 5.0


def test_a_fault_that_is_all_but_certain_is_no_trouble_to_plan_for() -> None:
    """Probabilities of 1 and next to 0: entropy and gain vanish together."""
    shipped = shipped_table(4)
    for rest in (0.0, 5e-324, 1e-300, 1e-17):
        group = {"jam": 1.0, "ball_nut_friction": rest, "spall": rest}
        assert build(group, FeatureChooser(shipped)).expected_cost >= 0.0


@pytest.mark.parametrize("truth", DRAG)
def test_a_tree_along_answers_ends_where_the_answers_led(truth: str) -> None:
    chooser = FeatureChooser(WORKED, "optimal", EXACT)
    group = dict.fromkeys(tuple(ROWS), 1.0)
    symbol_of = dict(zip(COLUMNS, ROWS[truth], strict=True))
    left, features = follow(group, chooser, symbol_of.__getitem__)
    asked = [(feature, symbol_of[feature]) for feature in features]
    node = asked_tree(group, chooser, asked)
    for feature, symbol in asked:
        assert node.feature == feature
        node = next(branch.node for branch in node.branches if branch.symbol == symbol)
    assert (set(node.faults), node.feature) == (set(left), None)


def test_a_tree_goes_on_as_planned_after_an_answer_that_never_came() -> None:
    chooser = FeatureChooser(WORKED, "optimal", EXACT)
    group = dict.fromkeys(DRAG, 1.0)
    first = chooser.next(normalised(group))
    assert first is not None
    (unanswered,) = [
        b for b in asked_tree(group, chooser, [(first, "?")]).branches if b.symbol == "?"
    ]
    assert set(unanswered.node.faults) == set(DRAG)
    assert unanswered.node.feature == chooser.next(normalised(group), (first,))
    assert asked_tree(group, chooser, ()) == build(group, chooser)


@given(st.data())
def test_all_answers_at_once_are_those_of_bayes_one_by_one(data: st.DataObject) -> None:
    table = load_features("feature_table.yaml")
    faults = sorted(data.draw(st.sets(st.sampled_from(table.faults), min_size=2, max_size=6)))
    odds = st.floats(0.0, 1.0).filter(lambda p: p == 0.0 or p > 1e-6)
    group = {fault: data.draw(odds) for fault in faults}
    assume(math.fsum(group.values()) > 0.0)
    question = Question(normalised(group), table, dict(table.costs), Rules())
    for feature in table.features[::5]:
        expected = list(outcomes(question.group, table, feature, rarest=RAREST).values())
        found = question.answers(feature)
        assert [p for p, _ in found] == pytest.approx([p for p, _ in expected])
        for (_, left), (_, wanted) in zip(found, expected, strict=True):
            assert left == pytest.approx(wanted)


def test_what_was_planned_is_remembered_with_the_table_and_for_odds_nearby() -> None:
    table = replace(load_features("feature_table.yaml"))
    near, nearer = ({"jam": p, "spall": 1.0 - p} for p in (0.301, 0.304))
    choice = FeatureChooser(table).next(near)
    (kept,) = table.plans.values()
    assert list(kept.values()) == [choice]
    other = FeatureChooser(table)
    assert other.next(nearer) == choice
    assert len(kept) == 1
    # Nobody is rounded out, and another table knows nothing of it.
    assert other.next({"jam": 1e-9, "spall": 1.0}) is not None
    assert replace(table).plans == {}
