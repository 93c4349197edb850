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


from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np
import pytest
from support import stands

from flea_diag.configuration.calibrations import load_calibration
from flea_diag.core.detection.window_limit import ResidualLimit, WindowLimit
from flea_diag.core.faults.fault import Fault
from flea_diag.core.isolation.fault_pairs import FaultPair, FaultPairs, members
from flea_diag.core.isolation.goodness_of_fit import GoodnessOfFit
from flea_diag.core.isolation.pair_clues import Clues
from flea_diag.core.isolation.pair_gains import pair_gains
from flea_diag.core.isolation.pair_models import (
    Death,
    Models,
    PairModels,
    deaths,
    delayed,
    together,
)
from flea_diag.core.likelihood.basis import Basis
from flea_diag.core.likelihood.estimation import fitted
from flea_diag.core.likelihood.evidence_sums import EvidenceSums
from flea_diag.core.likelihood.fault_models import FaultModel, Size, Term
from flea_diag.core.likelihood.fit import Fit
from flea_diag.core.likelihood.likelihood import FOLD, NormalEquations
from flea_diag.core.likelihood.weighing import Weighing, weighing_of

FORCE, VOLTS = NAMES = ("balance_of_forces", "circuit")
BASIS = Basis(("one", "elapsed_s", "wave"), (), ())
SIGMA, SCANS = 0.2, 20 * FOLD
SHIPPED = load_calibration("calibration_simulated_stand.yaml")
BIAS, LOAD, SCALED, DEAD = (
    "motor_voltage_bias", "load_force_bias", "motor_voltage_scaling", "motor_voltage_dead",
)  # fmt: skip


def limit(name: str) -> ResidualLimit:
    return ResidualLimit(name, (WindowLimit(FOLD, (0.0,) * 3, (SIGMA,) * 3, 5.0),), (1.0,) * 3)


def model(fault: str, *terms: Term, high: float = 20.0) -> FaultModel:
    sizes = tuple(
        Size(f"size {k}", "1", -high, high) for k in range(1 + max(t.index for t in terms))
    )
    return FaultModel(fault, sizes, terms)


MODELS: Mapping[str, Sequence[FaultModel]] = {
    BIAS: [model(BIAS, Term(VOLTS, "one", 1.0))],
    SCALED: [model(SCALED, Term(VOLTS, "wave", 1.0))],
    LOAD: [model(LOAD, Term(FORCE, "one", -1.0))],
    "jam": [model("jam", Term(FORCE, "one", 1.0), Term(FORCE, "wave", 1.0, 1))],
    DEAD: [model(DEAD, Term(VOLTS, "wave", 1.0), Term(VOLTS, "one", 1.0, 1))],
}


def evidence(*effects: tuple[str, Callable[[np.ndarray], np.ndarray]]) -> NormalEquations:
    """Both relations with white noise and these effects, as functions of wave."""
    y = np.random.default_rng(7).normal(0.0, SIGMA * math.sqrt(FOLD), (SCANS, 2))
    wave = np.sin(0.013 * np.arange(SCANS))
    for name, effect in effects:
        y[:, NAMES.index(name)] += effect(wave)
    found = NormalEquations(NAMES, BASIS)
    found.add(y, np.stack((np.ones(SCANS), 0.01 * np.arange(SCANS), wave), axis=1))
    return found


BOTH = evidence((VOLTS, lambda wave: 3.0 + 0.0 * wave), (FORCE, lambda wave: -4.0 + 0.0 * wave))


def weighing(sums: EvidenceSums) -> Weighing:
    scatter = dict.fromkeys(NAMES, SIGMA * math.sqrt(FOLD))
    return weighing_of(sums, scatter, dict.fromkeys(NAMES, 1.0), (), None, ())


def anything(_fault: Fault, _fit: Fit) -> bool:
    return True


def clues(
    seen: Mapping[str, Sequence[str]],
    firsts: Sequence[str] = (),
    is_possible: Callable[[Fault, Fit], bool] = anything,
    rivals: Sequence[str] = (),
) -> Clues:
    """What was seen, and which faults predict it."""
    predicted = {
        fault: frozenset(name for name, faults in seen.items() if fault in faults)
        for fault in MODELS
    }
    return Clues(predicted, frozenset(seen), frozenset(NAMES), firsts, is_possible, rivals)


SEEN = {VOLTS: (BIAS, SCALED, DEAD), FORCE: (LOAD, "jam")}


def dead(
    models: Models = MODELS,
    needed: Mapping[str, frozenset[str]] = MappingProxyType({}),
    told: Mapping[str, str] = MappingProxyType({}),
) -> dict[str, Death]:
    return deaths(stands.knowledge().faults, models, needed, told)


MOVED = {name: {t.residual for m in models for t in m.terms} for name, models in MODELS.items()}


def found(known: NormalEquations, said: Clues) -> list[tuple[str, str]]:
    return [pair.faults for pair in pairs(known, said)]


def search_of() -> FaultPairs:
    goodness = GoodnessOfFit(replace(SHIPPED, limits=tuple(map(limit, NAMES))), MOVED)
    return FaultPairs(stands.knowledge().faults, goodness, dead())


def pairs(known: NormalEquations, said: Clues, models: Models = MODELS) -> tuple[FaultPair, ...]:
    sums = known.now
    return search_of().search(sums, models, models, weighing(sums), said, 3.5)


def test_two_faults_are_found_with_their_sizes() -> None:
    best = pairs(BOTH, clues(SEEN))[0]
    assert set(best.faults) == {BIAS, LOAD}
    sizes = dict(zip(best.faults, (fit.sizes[0] for fit in best.fits), strict=True))
    assert sizes[BIAS] == pytest.approx(3.0, abs=0.3)
    assert sizes[LOAD] == pytest.approx(4.0, abs=0.3)


def test_what_one_fault_explains_is_no_pair() -> None:
    one = evidence((VOLTS, lambda wave: 3.0 + 0.0 * wave))
    assert found(one, clues({VOLTS: (BIAS, SCALED, DEAD)})) == []


@pytest.mark.parametrize(
    ("level", "heating", "held"),
    [(0.7, 0.0, True), (0.7, 0.01, True), (0.7, 0.2, False), (0.3, 0.0, False), (3.0, 0.2, True)],
)
def test_a_second_fault_within_the_limits_of_a_mean_must_explain_more(
    level: float, heating: float, held: bool
) -> None:
    """Of white noise a level adds ``SCANS / 2 (level / sigma)^2`` nats: 0.7 is 122, 0.3 is 22.

    A temperature that rises by 0.2 K/s may leave its prediction by as much without a fault of its
    own, one that rises by 0.01 K/s may not.
    """
    known = evidence(
        (FORCE, lambda wave: -4.0 + 0.0 * wave), (VOLTS, lambda wave: level + 0.0 * wave)
    )
    heats = {VOLTS: model("heat", Term(VOLTS, "elapsed_s", 1.0), high=heating)} if heating else {}
    said = replace(clues({FORCE: (LOAD,)}, rivals=(LOAD,)), heats=heats)
    assert ({BIAS, LOAD} in [set(pair) for pair in found(known, said)]) is held
    sums = known.now
    may = search_of().may_add(sums, MODELS, MODELS, weighing(sums), said)
    assert may is (level > 0.3)


@pytest.mark.parametrize("acts", [(), (Term(VOLTS, "wave", 1e-6),)])
def test_where_the_first_fault_does_not_act_its_model_lacks_nothing(acts: Sequence[Term]) -> None:
    """A level of 0.55 adds 38 nats: enough, unless what adds them may be of the first fault."""
    known = evidence(
        (FORCE, lambda wave: -4.0 + 0.0 * wave), (VOLTS, lambda wave: 0.55 + 0.0 * wave)
    )
    models = {**MODELS, LOAD: [model(LOAD, Term(FORCE, "one", -1.0), *acts)]}
    said = clues({FORCE: (LOAD,)}, rivals=(LOAD,))
    held = {BIAS, LOAD} in [set(pair.faults) for pair in pairs(known, said, models)]
    assert held is (not acts)


def test_what_a_model_is_off_by_is_a_share_of_what_it_explains_where_the_other_acts() -> None:
    """In the force there are 22 million nats, in the voltage 122."""
    known = evidence(
        (FORCE, lambda wave: -300.0 + 0.0 * wave), (VOLTS, lambda wave: 0.7 + 0.0 * wave)
    )
    unread = Term("a_relation_that_is_not_weighed", "one", 1.0)
    models = {
        **MODELS,
        LOAD: [model(LOAD, Term(FORCE, "one", -1.0), high=1000.0)],
        BIAS: [model(BIAS, Term(VOLTS, "one", 1.0), unread)],
    }
    said = clues({FORCE: (LOAD,)}, rivals=(LOAD,))
    assert {BIAS, LOAD} in [set(pair.faults) for pair in pairs(known, said, models)]


def test_no_pair_holds_beside_one_that_is_left_and_explains_as_much() -> None:
    known = evidence((VOLTS, lambda wave: 3.0 + 4.0 * wave))
    said = {VOLTS: (BIAS, SCALED, DEAD)}
    assert found(known, clues(said)) == [(BIAS, SCALED)]
    assert found(known, clues(said, rivals=(DEAD,))) == []


def test_a_pair_predicts_every_deviation() -> None:
    assert found(BOTH, clues(SEEN | {"motor_speed_stuck": ("motor_speed_dead",)})) == []


def test_a_test_of_a_single_sensor_asks_for_a_fault_whatever_relations_say() -> None:
    one = evidence((VOLTS, lambda wave: 3.0 + 0.0 * wave))
    said = clues({VOLTS: (BIAS,), "load_force_stuck": (LOAD,)})
    assert [set(pair) for pair in found(one, said)] == [{BIAS, LOAD}]


def test_a_pair_that_leaves_a_misfit_is_none() -> None:
    more = evidence(
        (VOLTS, lambda wave: 3.0 + 9.0 * np.abs(wave)), (FORCE, lambda wave: -4.0 + 0.0 * wave)
    )
    assert found(BOTH, clues(SEEN))
    assert found(more, clues({VOLTS: (BIAS,), FORCE: (LOAD,)})) == []


@pytest.mark.parametrize(
    ("uneven", "held"),
    [
        (lambda wave: 4.0 * wave, [{"jam", LOAD}]),
        (lambda wave: 4.0 * np.sign(np.diff(wave, prepend=0.0)), []),
    ],
)
def test_what_a_second_fault_takes_away_is_not_what_a_model_may_be_off_by(
    uneven: Callable[[np.ndarray], np.ndarray], held: list[set[str]]
) -> None:
    """A jam may leave as much as it explains, where no second fault explains that."""
    models = {
        **MODELS,
        "jam": [model("jam", Term(FORCE, "one", 1.0))],
        LOAD: [model(LOAD, Term(FORCE, "wave", 1.0))],
    }
    known = evidence((FORCE, lambda wave: 8.0 + uneven(wave)))
    said = clues({FORCE: (LOAD, "jam")})
    assert [set(pair.faults) for pair in pairs(known, said, models)] == held


def test_what_the_onset_rules_out_is_in_no_pair() -> None:
    said = clues(SEEN, is_possible=lambda fault, _fit: fault.name != LOAD)
    assert all(LOAD not in pair for pair in found(BOTH, said))


def test_a_pair_that_was_held_is_dropped_with_one_of_its_members() -> None:
    """The other pairs go on, though single sensors have ruled a member of one out meanwhile."""
    said, sums = clues(SEEN), BOTH.now
    left = {name: seen for name, seen in said.predicted.items() if name != DEAD}
    known = [(BIAS, LOAD), (DEAD, LOAD)]
    given = weighing(sums), replace(said, predicted=left), 3.5, known
    held = search_of().search(sums, MODELS, MODELS, *given)
    assert [set(pair.faults) for pair in held] == [{BIAS, LOAD}]


def test_the_first_fault_stays_the_first() -> None:
    assert {pair[0] for pair in found(BOTH, clues(SEEN, firsts=(LOAD,)))} == {LOAD}


def test_probabilities_of_members_add_up_to_two() -> None:
    held = pairs(BOTH, clues(SEEN))
    assert sum(pair.probability for pair in held) == pytest.approx(1.0)
    assert sum(members(held).values()) == pytest.approx(2.0)


def test_gains_are_those_of_fits_side_by_side() -> None:
    sums, known = BOTH.now, [MODELS[BIAS][0], MODELS[LOAD][0], MODELS["jam"][0], MODELS[SCALED][0]]
    asked = [(0, 1), (0, 2), (1, 3), (2, 3)]
    gains = {(g.one, g.other): g.nats for g in pair_gains(sums, known, asked, weighing(sums))}
    fits = fitted(sums, [together(known[a], known[b]) for a, b in asked], weighing(sums))
    # No dispersion: the first of these explains all.
    for pair, fit in zip(asked, fits, strict=True):
        assert gains[pair] == pytest.approx(fit.log_likelihood, rel=0.02, abs=0.5)


def test_gains_hold_sizes_to_their_bounds() -> None:
    sums = BOTH.now
    bounded = [model(BIAS, Term(VOLTS, "one", 1.0), high=1.0), MODELS[LOAD][0]]
    free = [MODELS[BIAS][0], MODELS[LOAD][0]]
    (less,), (more,) = (
        pair_gains(sums, each, [(0, 1)], weighing(sums)) for each in (bounded, free)
    )
    assert less.nats < more.nats - 10.0


def test_a_dead_reading_hides_what_else_acts_on_its_relations() -> None:
    both = PairModels(MODELS, MODELS, dead())
    (hidden,), (shown,) = both.beside(SCALED, DEAD), both.beside(LOAD, DEAD)
    assert (hidden.sizes, hidden.terms) == ((), ())
    assert shown.terms == MODELS[LOAD][0].terms
    assert [m.sizes for m in both.of((SCALED, DEAD))[0]] == [()]
    assert both.of((SCALED, BIAS)) == (MODELS[SCALED], MODELS[BIAS])


def test_a_dead_reading_hides_what_acts_on_relations_that_need_it() -> None:
    needed = {"motor_voltage": frozenset({FORCE})}
    (hidden,) = PairModels(MODELS, MODELS, dead(needed=needed)).beside(LOAD, DEAD)
    assert hidden.sizes == ()


def test_what_another_reading_tells_of_a_dead_one_leaves_the_other_relations() -> None:
    waves = [Term(name, "wave", 1.0) for name in NAMES]
    told = [model(DEAD, *waves, Term(VOLTS, "one", 1.0, 1))]
    models = {**MODELS, DEAD: told, SCALED: [model(SCALED, *waves)]}
    both = PairModels(models, models, dead(models, told={"motor_voltage": VOLTS}))
    (shown,) = both.beside(LOAD, DEAD)
    assert shown.terms == MODELS[LOAD][0].terms
    (hidden,) = both.beside(BIAS, DEAD)
    assert hidden.sizes == ()
    # It acts on the difference that tells the dead reading, and so on all that is told by it.
    (spoilt,) = both.beside(SCALED, DEAD)
    assert spoilt.sizes == ()


def test_a_drift_that_begins_later_is_nothing_at_its_onset() -> None:
    drift = model("motor_voltage_drift", Term(VOLTS, "elapsed_s", 2.0))
    late = delayed(drift, "elapsed_s", "one", 4.0)
    effect = dict.fromkeys(BASIS.names, 0.0)
    for term in late.terms:
        effect[term.regressor] += term.gain
    assert effect["one"] + 4.0 * effect["elapsed_s"] == 0.0
    assert effect["elapsed_s"] == 2.0


def test_sums_since_are_those_of_what_has_come_since() -> None:
    draw = np.random.default_rng(3)
    y, phi = draw.normal(size=(4 * FOLD, 2)), draw.normal(size=(4 * FOLD, 3))
    whole, late = NormalEquations(NAMES, BASIS), NormalEquations(NAMES, BASIS)
    whole.add(y[:FOLD], phi[:FOLD])
    before = whole.now.copy()
    whole.add(y[FOLD:], phi[FOLD:])
    late.add(y[FOLD:], phi[FOLD:])
    since, expected = whole.now.since(before), late.now
    for name in ("gram", "cross", "square", "samples", "means", "blocks"):
        np.testing.assert_allclose(getattr(since, name), getattr(expected, name), atol=1e-9)
