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

"""What a unit showed while it was healthy: what is kept, what is left out, what it is good for."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from support.models.fault_terms import BASIS, EFFECTS, RATE
from support.observed import FLEA_COUNTS, FLEA_TOLERANCE, flea_parameters

from flea_diag.core.likelihood.likelihood import NormalEquations
from flea_diag.core.likelihood.unit_baseline import (
    LEAST_PIECES,
    LEFT_OUT,
    PIECE_S,
    UnitBaseline,
)
from flea_diag.core.residuals.parameters import UNIT_PARAMETERS
from flea_diag.core.residuals.unit_difference import difference_sigmas

PIECE_SCANS = FLEA_COUNTS.of(PIECE_S)
RESIDUALS = ("parity_mechanical", "parity_electrical")
SIGMA = dict(zip(RESIDUALS, (20.0, 0.9), strict=True))
SPACING = dict.fromkeys(RESIDUALS, 40.0)
TOLERANCE = difference_sigmas(FLEA_TOLERANCE, (*UNIT_PARAMETERS, "one", "two", "three"))
P = flea_parameters()


def scans(seed: int, count: int, current_bias_a: float = 0.0, zero_v: float = 0.0):
    """Residuals of a moving actuator, and their regressors."""
    random = np.random.default_rng(seed)
    for k in range(count):
        speed = 0.05 * np.cos(2 * np.pi * 0.5 * k / 100.0)
        known = {"one": 1.0, "direction": np.sign(speed), RATE: speed, "motor_current": 0.6}
        regressors = np.array([known.get(name, 0.0) for name in BASIS.names])
        error = P.force_constant_n_per_a, -P.winding_resistance_ohm
        noise = random.standard_normal(2) * (3.0, 0.15)
        yield np.array(error) * current_bias_a + (0.0, zero_v) + noise, regressors


def stretch(seen) -> UnitBaseline:
    found = UnitBaseline(RESIDUALS, BASIS, counts=FLEA_COUNTS)
    for values, regressors in seen:
        found.add(values[None], regressors[None])
    return found


def test_nothing_is_known_before_enough_has_been_seen():
    enough = PIECE_SCANS * (LEAST_PIECES + LEFT_OUT) + 1
    assert stretch(scans(1, enough - 2)).evidence is None
    assert stretch(scans(1, enough + PIECE_SCANS)).evidence is not None


def test_the_last_seconds_are_left_out_and_an_interruption_drops_them():
    count = PIECE_SCANS * 12
    marked = [
        (values + np.array((0.0, 100.0 * (k >= count - PIECE_SCANS * LEFT_OUT))), regressors)
        for k, (values, regressors) in enumerate(scans(2, count))
    ]
    found = stretch(marked)
    before = found.evidence.samples.copy()
    square = found.evidence.sums.square[1] / found.evidence.samples[1]
    assert square == pytest.approx(0.15**2, rel=0.3)
    found.interrupt()
    for values, regressors in scans(3, PIECE_SCANS * LEFT_OUT):
        found.add(values[None], regressors[None])
    assert np.array_equal(found.evidence.samples, before)


def test_what_is_old_fades():
    day = stretch(scans(4, PIECE_SCANS * 400)).evidence.samples[0]
    # A geometric series of pieces of 100 samples with a memory of 60 pieces.
    assert day == pytest.approx(PIECE_SCANS / (1 - np.exp(-1 / 60)), rel=0.02)


def test_a_known_zero_of_the_voltage_tells_a_current_bias_from_a_load_bias():
    zero_v = 0.7  # another unit's voltage channel: within what healthy units differ by
    episode = NormalEquations(RESIDUALS, BASIS)
    for values, regressors in scans(5, 500, current_bias_a=0.35, zero_v=zero_v):
        episode.add(values[None], regressors[None])
    biases = ("motor_current_bias", "load_force_bias")
    models = [m for m in EFFECTS.bound(P) if m.fault in biases]
    healthy = stretch(scans(6, PIECE_SCANS * 12, zero_v=zero_v)).evidence

    def ahead(known: NormalEquations | None) -> float:
        fits = episode.fit(models, SIGMA, SPACING, TOLERANCE, known, RESIDUALS[1:])
        by_fault = {fit.fault: fit.log_likelihood for fit in fits}
        return by_fault["motor_current_bias"] - by_fault["load_force_bias"]

    assert ahead(None) < 3.5 < ahead(healthy)
    fits = episode.fit(models, SIGMA, SPACING, TOLERANCE, healthy, RESIDUALS[1:])
    sizes = {fit.fault: fit.sizes for fit in fits}
    assert sizes["motor_current_bias"][0] == pytest.approx(0.35, abs=0.05)


def test_only_relations_that_are_named_show_the_units_own():
    episode = NormalEquations(RESIDUALS, BASIS)
    for values, regressors in scans(5, 500, current_bias_a=0.1):
        episode.add(values[None], regressors[None])
    models = [m for m in EFFECTS.bound(P) if m.fault == "motor_current_bias"]
    known = stretch(scans(6, PIECE_SCANS * 12)).evidence

    def figures(*baseline: Any) -> list[Any]:
        fits = episode.fit(models, SIGMA, SPACING, TOLERANCE, *baseline)
        return [(fit, fit.sigmas, fit.left) for fit in fits]

    nothing = figures()
    assert figures(known) == nothing
    assert figures(known, RESIDUALS[1:]) != nothing


@pytest.mark.parametrize("block", [3, 250, 1300])
def test_blocks_show_the_same_as_single_scans(block):
    seen = list(scans(7, PIECE_SCANS * 13))
    values, regressors = (np.array(column) for column in zip(*seen, strict=True))
    found = UnitBaseline(RESIDUALS, BASIS, counts=FLEA_COUNTS)
    for start in range(0, len(values), block):
        part = slice(start, start + block)
        found.add(values[part], regressors[part])
    single = stretch(seen).evidence
    assert np.array_equal(found.evidence.sums.gram, single.sums.gram)
    assert np.array_equal(found.evidence.sums.cross, single.sums.cross)
