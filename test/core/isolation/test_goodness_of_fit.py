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

"""Whether the most likely hypothesis fits by itself, held against sums over the samples."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from support import stands

from flea_diag.configuration.calibrations import load_calibration
from flea_diag.core.detection.window_limit import ResidualLimit, WindowLimit
from flea_diag.core.isolation.goodness_of_fit import GoodnessOfFit, MeanScatter, Misfit
from flea_diag.core.likelihood.basis import Basis, UnitTerm
from flea_diag.core.likelihood.fault_models import FaultModel, Size, Term
from flea_diag.core.likelihood.fit import Fit
from flea_diag.core.likelihood.likelihood import FOLD, NormalEquations

NAMES = ("one_relation", "another")
BASIS = Basis(("one", "wave"), (), ())
SIGMA, K = 0.2, 5.0
"""Scatter of the means of nominal recordings, and the limit of one of them."""
BLOCKS = 12


def limit(name: str) -> ResidualLimit:
    short, long = ((50, SIGMA), (400, 0.25 * SIGMA))
    windows = tuple(WindowLimit(w, (0.0,) * 3, (s,) * 3, K) for w, s in (short, long))
    return ResidualLimit(name, windows, (1.0,) * 3)


SHIPPED = load_calibration("calibration_simulated_stand.yaml")
CALIBRATION = replace(SHIPPED, limits=tuple(map(limit, NAMES)))
BOTH = FaultModel(
    "both",
    (Size("size", "1", -9.0, 9.0),),
    (Term(NAMES[0], "one", 1.0), Term(NAMES[1], "one", 1.0)),
)
FIRST = FaultModel("first", (Size("size", "1", -9.0, 9.0),), (Term(NAMES[0], "one", 1.0),))


def evidence(
    levels: tuple[float, float], step: int = FOLD, wave: float = 0.0, basis: Basis = BASIS
) -> tuple[NormalEquations, np.ndarray]:
    """Two relations at these levels, the first with a wave, and white noise as in healthy ones."""
    noise = np.random.default_rng(4).normal(0.0, SIGMA * math.sqrt(FOLD), (BLOCKS * FOLD, 2))
    y = np.array(levels) + noise
    phi = np.stack((np.ones(len(y)), np.sin(0.01 * np.arange(len(y)))), axis=1)
    y[:, 0] += wave * phi[:, 1]
    found = NormalEquations(NAMES, basis)
    for start in range(0, len(y), step):
        found.add(y[start : start + step], phi[start : start + step])
    return found, y


def fitted(known: NormalEquations, model: FaultModel) -> Fit:
    scatter = dict.fromkeys(NAMES, SIGMA * math.sqrt(FOLD))
    (fit,) = known.fit((model,), scatter, dict.fromkeys(NAMES, 1.0), ())
    return fit


def misfits(known: NormalEquations, model: FaultModel, fault: str = "jam") -> tuple[Misfit, ...]:
    faults = stands.knowledge().faults
    moved = {fault: {term.residual for term in model.terms}}
    goodness = GoodnessOfFit(CALIBRATION, moved)
    return goodness.misfits(known.now, (faults[fault],), fitted(known, model))


def poor(
    levels: tuple[float, float], model: FaultModel, fault: str = "jam", wave: float = 0.0
) -> list[str]:
    known, _ = evidence(levels, wave=wave)
    return [row.residual for row in misfits(known, model, fault)]


def test_a_fault_that_explains_what_deviates_fits() -> None:
    assert poor((3.0, 3.0), BOTH) == []
    assert poor((3.0, 0.0), FIRST) == []


def test_a_relation_that_the_fault_does_not_move_and_that_deviates_is_named() -> None:
    assert poor((3.0, 3.0), FIRST) == ["another"]


def test_what_the_unit_accounts_for_excuses_no_relation_that_the_fault_does_not_move() -> None:
    """A level of 8 that units may differ by, and a wave that nothing explains."""
    units = Basis(BASIS.names, (UnitTerm(NAMES[0], "offset", "one", 1.0),), ("offset",))
    known, _ = evidence((8.0, 3.0), wave=4.0, basis=units)
    scatter = dict.fromkeys(NAMES, SIGMA * math.sqrt(FOLD))
    second = FaultModel("second", FIRST.sizes, (Term(NAMES[1], "one", 1.0),))
    (fit,) = known.fit((second,), scatter, dict.fromkeys(NAMES, 1.0), (5.0,))
    jam = stands.knowledge().faults["jam"]
    for moved, words in (((NAMES[1],), [NAMES[0]]), (NAMES, [])):
        found = GoodnessOfFit(CALIBRATION, {"jam": moved}).misfits(known.now, (jam,), fit)
        assert [row.residual for row in found] == words


def test_a_relation_that_the_fault_should_move_and_that_stays_quiet_is_named() -> None:
    # Half of the level is left in the one that deviates, and as much is too much in the other.
    assert "another" in poor((3.0, 0.0), BOTH)


@pytest.mark.parametrize(("fault", "words"), [("jam", []), ("load_force_bias", [NAMES[0]])])
def test_an_error_of_a_reading_leaves_less_than_a_drag_may(fault: str, words: list[str]) -> None:
    # A third of it, as root mean squares: as a slip of the gear leaves of a scaled position.
    assert poor((8.0, 0.0), FIRST, fault, wave=4.0) == words
    assert poor((8.0, 0.0), FIRST, fault, wave=2.0) == []


@pytest.mark.parametrize(("wave", "exceeds"), [(4.0, True), (0.0, False)])
def test_what_a_model_may_be_off_by_is_more_than_noise(wave: float, exceeds: bool) -> None:
    known, _ = evidence((8.0, 0.0), wave=wave)
    fit, jam = fitted(known, FIRST), stands.knowledge().faults["jam"]
    moved = {"jam": NAMES[:1]}
    goodness = GoodnessOfFit(CALIBRATION, moved)
    assert not goodness.misfits(known.now, (jam,), fit)
    assert goodness.exceeded_by_all(known.now, [(jam, fit)]) is exceeds
    assert not goodness.exceeded_by_all(known.now, [(jam, fit), (jam, None)])
    # Of heat no model says how much it is.
    assert not GoodnessOfFit(CALIBRATION, moved, moved).exceeded_by_all(known.now, [(jam, fit)])


def test_what_is_left_is_said_in_healthy_scatters() -> None:
    known, y = evidence((3.0, 3.0))
    (row,) = misfits(known, FIRST)
    means = y[:, 1].reshape(BLOCKS, FOLD).mean(axis=1)
    assert row.scatter == pytest.approx(math.sqrt(np.mean(means**2)) / SIGMA)
    assert row.scatter > row.limit


@pytest.mark.parametrize("model", [BOTH, FIRST])
def test_what_is_left_is_that_of_the_block_means(model: FaultModel) -> None:
    known, y = evidence((3.0, 2.0))
    fit = fitted(known, model)
    means = y.reshape(BLOCKS, FOLD, 2).mean(axis=1)
    moved = [fit.sizes[0] if model is BOTH or k == 0 else 0.0 for k in range(2)]
    np.testing.assert_allclose(fit.left, ((means - moved) ** 2).sum(axis=0))
    np.testing.assert_allclose(known.now.shown, (means**2).sum(axis=0))


def test_blocks_are_whole_however_often_the_evidence_is_looked_at() -> None:
    # As at 25 Hz: it is fitted every 12 scans, and four such are less than a block.
    found, y = NormalEquations(NAMES, BASIS), np.ones((120, 2))
    for start in range(0, 120, 12):
        found.add(y[start : start + 12], np.ones((12, 2)))
        fitted(found, BOTH)
    assert found.now.blocks.tolist() == [2.0, 2.0]
    np.testing.assert_allclose(found.now.shown, 2.0)


def test_no_fit_is_poor_that_leaves_what_healthy_means_may_reach() -> None:
    assert poor((0.0, 0.9 * K * SIGMA), FIRST) == []
    assert poor((0.0, 1.3 * K * SIGMA), FIRST) == ["another"]


def test_a_mean_over_a_block_has_the_limit_of_the_shortest_window() -> None:
    assert MeanScatter.of(CALIBRATION, NAMES[0]) == MeanScatter(pytest.approx(SIGMA**2), K)
    assert MeanScatter.of(CALIBRATION, "unknown") is None
