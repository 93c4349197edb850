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

import numpy as np
import pytest
from scipy import optimize
from support.models.fault_terms import (
    BASIS,
    BIAS,
    DRAG,
    DRIVE,
    EFFECTS,
    ELECTRICAL,
    LOAD,
    MECHANICAL,
    RATE,
    RESIDUALS,
    SIGMA,
    SPACING,
    TOLERANCE,
)
from support.observed import flea_parameters

from flea_diag.core.likelihood.basis import designs_of
from flea_diag.core.likelihood.fault_models import FaultModel, Size, Term
from flea_diag.core.likelihood.likelihood import NormalEquations

UNITS = len(TOLERANCE)
MODELS = (DRAG, BIAS, LOAD)
# What another unit may differ by: (row, regressor, sign), as the relations say.
UNIT = {
    "coulomb_friction_n": (0, "direction"),
    "viscous_friction_n_s_per_m": (0, RATE),
    "winding_resistance_ohm": (1, "motor_current"),
    "back_emf_v_s_per_m": (1, RATE),
    "voltage_offset_v": (1, "one"),
}


def window(seed: int, count: int = 300) -> dict[str, np.ndarray]:
    random = np.random.default_rng(seed)
    v = 0.05 * np.sin(np.linspace(0, 9 + seed, count))
    columns = {name: np.zeros(count) for name in BASIS.names}
    columns |= {
        "one": np.ones(count),
        "direction": np.tanh(v / 0.004),
        RATE: v,
        "motor_current": random.normal(0, 1, count),
        "load_force": 50.0 + 40.0 * np.cos(np.linspace(0, 7, count)),
    }
    return columns


def effect(model: FaultModel, sizes, columns) -> np.ndarray:
    y = np.zeros((2, len(columns["one"])))
    for term in model.terms:
        y[RESIDUALS.index(term.residual)] += sizes[term.index] * term.gain * columns[term.regressor]
    return y


def evidence(y: np.ndarray, columns) -> NormalEquations:
    found = NormalEquations(RESIDUALS, BASIS)
    table = np.stack([columns[name] for name in BASIS.names], axis=1)
    for start in range(0, len(table), 37):
        found.add(y.T[start : start + 37], table[start : start + 37])
    return found


def reference(model: FaultModel | None, y, columns):
    """Misfit and sizes by bounded least squares on the samples themselves."""
    count = 0 if model is None else len(model.sizes)
    weight = [1 / (SIGMA[r] * math.sqrt(SPACING[r])) for r in RESIDUALS]
    blocks, right = [], []
    for row in range(2):
        A = np.zeros((y.shape[1], count + UNITS))
        for k in range(count):
            A[:, k] = effect(model, np.eye(count)[k], columns)[row]
        for name, (where, regressor) in UNIT.items():
            if where == row:
                A[:, count + BASIS.differences.index(name)] = -columns[regressor]
        use = np.isfinite(y[row])
        blocks.append(A[use] * weight[row])
        right.append(y[row, use] * weight[row])
    blocks.append(np.hstack((np.zeros((UNITS, count)), np.diag(1 / np.array(TOLERANCE)))))
    A, b = np.vstack(blocks), np.concatenate([*right, np.zeros(UNITS)])
    low = [size.low for size in (model.sizes if model else ())] + [-np.inf] * UNITS
    high = [size.high for size in (model.sizes if model else ())] + [np.inf] * UNITS
    scale = np.linalg.norm(A, axis=0)
    found = optimize.lsq_linear(A / scale, b, (low * scale, high * scale), tol=1e-14)
    return 2 * found.cost, found.x[:count] / scale[:count]


def fits(found: NormalEquations, models=MODELS):
    return found.fit(models, SIGMA, SPACING, TOLERANCE)


@pytest.mark.parametrize("seed", range(25))
def test_misfit_and_sizes_are_those_of_bounded_least_squares(seed):
    random = np.random.default_rng(100 + seed)
    columns = window(seed)
    true = MODELS[seed % 3]
    sizes = [random.uniform(max(s.low, -2), min(s.high, 100)) for s in true.sizes]
    y = effect(true, sizes, columns)
    y += 0.3 * random.standard_normal(y.shape) * [[SIGMA[r]] for r in RESIDUALS]
    y[random.random(y.shape) < 0.1] = np.nan
    nominal, _ = reference(None, y, columns)
    n = sum(np.isfinite(y[k]).sum() / SPACING[r] for k, r in enumerate(RESIDUALS))
    # The true model is among them and leaves less than noise: nothing dampens the gains.
    for model, fit in zip(MODELS, fits(evidence(y, columns)), strict=True):
        misfit, expected = reference(model, y, columns)
        at_bound = sum(
            not size.low + 1e-6 < x < size.high - 1e-6
            for size, x in zip(model.sizes, expected, strict=True)
        )
        gain = 0.5 * (nominal - misfit)
        penalty = 0.5 * (len(expected) - at_bound) * math.log(n)
        np.testing.assert_allclose(fit.sizes, expected, atol=1e-3, rtol=1e-3, err_msg=model.fault)
        assert fit.log_likelihood == pytest.approx(gain - penalty, abs=1e-3, rel=1e-4)


def test_a_viscous_drag_is_fitted_however_sharp_a_temperature_is():
    columns, node = window(5), "ambient_temperature"
    columns["elapsed_s"] = np.linspace(0.0, 30.0, 300)
    y = effect(DRAG, (0.0, 400.0), columns)[0] + np.random.default_rng(5).normal(0.0, 2.0, 300)
    found = NormalEquations((MECHANICAL, node), BASIS)
    table = np.stack([columns[name] for name in BASIS.names], axis=1)
    found.add(np.stack((y, np.zeros(300)), axis=1), table)
    sigma, spacing = {MECHANICAL: 4.0, node: 1e-4}, {MECHANICAL: 40.0, node: 40.0}
    (sharp,) = found.fit((DRAG,), sigma, spacing, TOLERANCE)
    (alone,) = found.fit((DRAG,), sigma | {node: 1.0}, spacing, TOLERANCE)
    assert alone.sizes[1] == pytest.approx(400.0, rel=0.3)
    assert sharp.sizes == pytest.approx(alone.sizes, rel=1e-4, abs=1e-4)
    assert sharp.sigmas == pytest.approx(alone.sigmas, rel=1e-4)


@pytest.mark.parametrize(("model", "sizes"), [(DRAG, (80.0, 900.0)), (BIAS, (0.6,))])
def test_the_size_lies_within_its_error_and_the_true_fault_wins(model, sizes):
    pulls = []
    for seed in range(30):
        columns = window(seed, 600)
        noise = np.random.default_rng(seed).standard_normal((2, 600))
        # White noise whose mean scatters as that of the coloured one does.
        y = effect(model, sizes, columns)
        y += noise * [[SIGMA[r] * math.sqrt(SPACING[r])] for r in RESIDUALS]
        found = {fit.fault: fit for fit in fits(evidence(y, columns))}
        best = max(found.values(), key=lambda fit: fit.log_likelihood)
        assert best.fault == model.fault
        fit = found[model.fault]
        pulls.append((fit.sizes[0] - sizes[0]) / fit.sigmas[0])
    # The spread of units is in the error: it is no smaller than the scatter.
    assert abs(np.mean(pulls)) < 1.0
    assert np.std(pulls) < 1.3


def test_no_fault_explains_a_healthy_window_better_than_none():
    columns = window(1)
    y = 0.5 * np.random.default_rng(1).standard_normal((2, 300)) * [[12.0], [0.6]]
    assert max(fit.log_likelihood for fit in fits(evidence(y, columns))) <= 1e-9


def test_what_another_unit_may_differ_by_is_hardly_held_against_it():
    columns = window(2)
    friction = 10.0 * columns["direction"]
    y = np.stack((friction, np.zeros(300)))
    (drag, *_) = fits(evidence(y, columns))
    y = np.stack((10 * friction, np.zeros(300)))
    (jam, *_) = fits(evidence(y, columns))
    assert drag.log_likelihood < 3.0 < jam.log_likelihood


def test_a_misfit_of_all_models_makes_them_less_sure():
    columns = window(3)
    noise = 4.0 * np.random.default_rng(3).standard_normal((2, 300)) * [[12.0], [0.6]]
    y = effect(DRAG, (150.0, 0.0), columns)
    sure, unsure = (fits(evidence(each, columns), (DRAG,))[0] for each in (y, y + noise))
    assert 0.0 < unsure.log_likelihood < 0.8 * sure.log_likelihood


def test_a_fault_that_scatters_forgives_a_rough_effect_and_pays_for_it():
    columns = window(4)
    random = np.random.default_rng(4)
    rough = FaultModel(DRAG.fault, DRAG.sizes, DRAG.terms, roughness=0.5)
    y = effect(DRAG, (200.0, 0.0), columns)
    even = fits(evidence(y, columns), (DRAG,))[0], fits(evidence(y, columns), (rough,))[0]
    assert even[0].log_likelihood > even[1].log_likelihood
    y *= 1.0 + 0.5 * random.standard_normal(y.shape)
    scattered = fits(evidence(y, columns), (rough,))[0]
    assert scattered.sizes[0] + 0.055 * scattered.sizes[1] == pytest.approx(200.0, rel=0.25)


def test_a_fault_that_scatters_has_fewer_sizes_than_those_beside_it():
    columns = window(4)
    rough = FaultModel(DRAG.fault, DRAG.sizes[:1], DRAG.terms[:1], roughness=0.5)
    alone, beside = fits(evidence(effect(DRAG, (200.0, 0.0), columns), columns), (rough, DRAG))
    assert len(alone.sizes) == 1
    assert len(beside.sizes) == 2
    assert alone.sizes[0] == pytest.approx(200.0, rel=0.05)


def test_without_evidence_there_is_no_preference():
    for fit in fits(NormalEquations(RESIDUALS, BASIS)):
        assert fit.log_likelihood == pytest.approx(0.0, abs=2.0)
        assert all(math.isfinite(size) for size in fit.sizes)


@pytest.mark.parametrize(
    # Beside 45 N of its own, of which healthy units differ by 10; 65 N are the FLEA's jam.
    ("dry_n", "viscous", "turning", "jammed"),
    [(110.0, 0.0, False, True), (110.0, 0.0, True, True), (65.0, 2000.0, True, False)],
)
def test_lost_lubrication_neither_holds_the_shaft_nor_rubs_as_a_jam_does(
    dry_n, viscous, turning, jammed
):
    columns = window(5, 600)
    columns["direction"] = np.sign(columns[RATE])
    columns[RATE] = columns[RATE] * turning
    y = np.stack((dry_n * columns["direction"] + viscous * columns[RATE], np.zeros(600)))
    y[0] += 12.0 * np.random.default_rng(5).standard_normal(600)
    own = flea_parameters(coulomb_friction_n=45.0, load_friction_ratio=0.05)
    models = [m for m in EFFECTS.bound(own) if m.fault in ("jam", "ball_nut_friction")]
    best: dict[str, float] = {}
    for fit in fits(evidence(y, columns), models):
        best[fit.fault] = max(best.get(fit.fault, -math.inf), fit.log_likelihood)
    behind = best["jam"] - best["ball_nut_friction"]
    assert behind > 3.5 if jammed else behind == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("seed", range(20))
def test_the_sizes_of_a_jam_are_held_to_their_bounds_at_the_optimum(seed):
    models = (m for m in EFFECTS.bound(flea_parameters()) if m.fault == "jam")
    jam = max((m for m in models if not m.roughness), key=lambda m: len(m.sizes))
    random, columns = np.random.default_rng(seed), window(seed)
    force = columns["load_force"] + 60.0 * columns["direction"] + 500.0 * columns[RATE]
    columns["fabs(load_force)*direction"] = np.abs(columns["load_force"]) * columns["direction"]
    columns["fabs(motor_current)*direction"] = np.abs(force) / 177.0 * columns["direction"]
    y = effect(
        jam, [random.uniform(0, 150), random.uniform(0, 2000), 0.3, 0.0][: len(jam.sizes)], columns
    )
    y += random.standard_normal(y.shape) * [[24.0], [0.8]]
    (fit,) = fits(evidence(y, columns), (jam,))
    _, expected = reference(jam, y, columns)
    np.testing.assert_allclose(effect(jam, fit.sizes, columns), effect(jam, expected, columns),
                               atol=0.05)  # fmt: skip


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("lost_drop", [0.0, 0.04])
def test_an_open_winding_pays_for_a_drive_nearer_to_its_command_only_where_there_is_one(
    lost_drop, seed
):
    """At rest, no current; the loop winds up, so that the voltage rises as a drift would."""
    residuals, count = (MECHANICAL, ELECTRICAL, DRIVE), 150
    columns = {name: np.zeros(count) for name in BASIS.names}
    columns["one"] += 1.0
    columns["elapsed_s"] = 0.01 * np.arange(count)
    columns["commanded_voltage"] = 6.0 + 3.0 * columns["elapsed_s"]
    voltage = (1.0 + lost_drop) * columns["commanded_voltage"]
    columns["motor_voltage"] = voltage
    noise = np.random.default_rng(seed).standard_normal((2, count))
    y = np.stack((np.full(count, np.nan), voltage + 0.3 * noise[0],
                  lost_drop * columns["commanded_voltage"] + 0.1 * noise[1]))  # fmt: skip
    found = NormalEquations(residuals, BASIS)
    found.add(y.T, np.stack([columns[name] for name in BASIS.names], axis=1))
    lost = Size("share lost", "1", 0.7, 1.1)
    plain = FaultModel("plain", (lost,), (Term(ELECTRICAL, "motor_voltage", 1.0),))
    models = (*EFFECTS.bound(flea_parameters()), plain)
    made = found.fit(models, dict.fromkeys(residuals, 0.3) | {DRIVE: 0.1},
                     dict.fromkeys(residuals, 4.0), TOLERANCE)  # fmt: skip
    best = {name: max(f.log_likelihood for f in made if f.fault == name)
            for name in {f.fault for f in made}}  # fmt: skip
    assert best["winding_open"] == best["motor_failure"]
    assert best["winding_open"] == max(best.values())
    if lost_drop:
        assert best["winding_open"] > best["plain"] + 10.0
    else:
        assert best["winding_open"] == best["plain"]


@pytest.mark.parametrize(("rise_k", "told_apart"), [(1.0, False), (12.0, True)])
def test_a_bias_of_a_temperature_is_told_from_a_scaling_once_more_changes_than_a_unit_heats_by(
    rise_k, told_apart
):
    node, count = "motor_temperature", 2000
    bias = FaultModel("bias", (Size("b", "K", -60.0, 60.0),), (Term(node, "one", 1.0),))
    scaled = (Term(node, "motor_temperature_degc", 1.0),)
    scaling = FaultModel("scaling", (Size("g", "1", -0.7, 0.4),), scaled)
    elapsed = 0.01 * np.arange(count)
    columns = {name: np.zeros(count) for name in BASIS.names}
    # Not in step with time: a rate of heating could not be told from a straight line.
    expected = 30.0 + rise_k * np.sqrt(elapsed / elapsed[-1])
    columns |= {"one": np.ones(count), "elapsed_s": elapsed, "motor_temperature_degc": expected}
    heated_k = 0.02 * (15.0 + elapsed)
    y = 0.15 * expected + heated_k + 0.1 * np.random.default_rng(7).standard_normal(count)
    found = NormalEquations((node,), BASIS)
    found.add(y[:, None], np.stack([columns[name] for name in BASIS.names], axis=1))
    one, other = found.fit((bias, scaling), {node: 0.5}, {node: 20.0}, TOLERANCE)
    assert (other.log_likelihood - one.log_likelihood > 3.5) is told_apart
    assert one.log_likelihood < 3.5 + other.log_likelihood


@pytest.mark.parametrize(
    ("drag_n", "low", "high", "held", "counted"),
    [
        (60.0, 0.0, 20.0, 20.0, 1),  # as large as it may be: fitted like any other
        (-60.0, 0.0, 20.0, 0.0, 0),  # not there
        (-60.0, -20.0, 20.0, -20.0, 1),
        (5.0, 15.0, 20.0, 15.0, 1),  # as small as it may be: fitted, too
    ],
)
def test_a_size_costs_unless_it_is_0(drag_n, low, high, held, counted):
    rattle = FaultModel("rattle", (Size("coulomb", "N", low, high),), DRAG.terms[:1])
    columns = window(3)
    y = effect(DRAG, (drag_n, 0.0), columns)
    y += np.random.default_rng(3).normal(0.0, 1.0, y.shape)
    (found,) = fits(evidence(y, columns), (rattle, DRAG))[:1]
    assert found.sizes[0] == pytest.approx(held, abs=1e-9)
    gain = 0.5 * (reference(None, y, columns)[0] - reference(rattle, y, columns)[0])
    cost = 0.5 * counted * math.log(300 / SPACING[MECHANICAL])
    assert found.log_likelihood == pytest.approx(gain - cost, abs=0.05 + 0.01 * abs(gain))


def test_what_nothing_was_seen_of_is_held_against_no_fault():
    """The shaft stood still: however long the winding was watched, that says nothing of a drag."""
    least = FaultModel("drag", (Size("coulomb", "N", 20.0, 100.0),), DRAG.terms[:1])
    columns = window(3)
    y = np.zeros((2, len(columns["one"])))
    y[0] = np.nan
    (found,) = fits(evidence(y, columns), (least,))
    assert found.sizes == (20.0,)
    assert found.log_likelihood == pytest.approx(-0.5 * math.log(2.0))


def test_designs_are_made_once_and_of_residuals_that_they_enter():
    untouched = "nothing_enters_it"
    rough = FaultModel(DRAG.fault, DRAG.sizes, DRAG.terms, roughness=0.5)
    made = designs_of((DRAG, rough, LOAD), (untouched, *RESIDUALS), BASIS)
    assert made is designs_of((DRAG, rough, LOAD), (untouched, *RESIDUALS), BASIS)
    assert made.places == (0, 0, 1)
    assert made.entered.tolist() == [1, 2]
    assert not made.every[:, 0].any()
    np.testing.assert_array_equal(made.every[:, 1:], made.own)
