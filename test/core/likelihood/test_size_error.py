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

"""How the error of a size splits into that of the unit and that of the recording."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from support.models.fault_terms import BASIS, DRAG, RATE, RESIDUALS, SIGMA, TOLERANCE

from flea_diag.core.likelihood.fit import SizeError, Solution
from flea_diag.core.likelihood.likelihood import NormalEquations

WHITE = dict.fromkeys(RESIDUALS, 1.0)
COUNT = len(TOLERANCE)
FREE = replace(
    DRAG, sizes=tuple(replace(s, low=-math.inf, high=math.inf) for s in DRAG.sizes), roughness=0.0
)
FRICTION = BASIS.differences.index("coulomb_friction_n")


def recorded(random: np.random.Generator, unit: float, scans: int) -> list[NormalEquations]:
    """Pieces of a recording: a drag of 20 N, a unit whose dry friction differs, white noise."""
    places = {name: place for place, name in enumerate(BASIS.names)}
    pieces = []
    for _ in range(10):
        v = 0.05 * np.sin(np.linspace(0.0, 60.0, scans // 10))
        signals = np.zeros((len(v), len(BASIS.names)))
        signals[:, places["one"]] = 1.0
        signals[:, places["direction"]] = np.tanh(v / 0.004)
        signals[:, places[RATE]] = v
        noise = SIGMA[RESIDUALS[0]] * random.normal(size=len(v))
        y = np.full((len(v), len(RESIDUALS)), np.nan)
        y[:, 0] = (20.0 - unit) * signals[:, places["direction"]] + noise
        pieces.append(NormalEquations(RESIDUALS, BASIS))
        pieces[-1].add(y, signals)
    return pieces


def sized(pieces: list[NormalEquations], share: np.ndarray) -> tuple[float, SizeError, SizeError]:
    """Dry drag, its error by the stated noise, and by the scatter of the pieces."""
    whole = NormalEquations(RESIDUALS, BASIS)
    for piece in pieces:
        whole.take(piece, 1.0)
    (fit,) = whole.fit([FREE], SIGMA, WHITE, TOLERANCE)
    assert isinstance(fit.solution, Solution)
    stated, shown = (
        fit.solution.errors(share, of)[0] for of in ((), [piece.now for piece in pieces])
    )
    assert stated.total == pytest.approx(fit.sigmas[0])
    return fit.sizes[0], stated, shown


def test_what_the_unit_differs_by_is_shared_and_as_large_as_its_tolerance() -> None:
    """Dry friction and a dry drag are one signal: no recording tells them apart."""
    _, stated, shown = sized(recorded(np.random.default_rng(1), 0.0, 4000), np.zeros(COUNT))
    assert stated.shared == pytest.approx(TOLERANCE[FRICTION], rel=0.05)
    assert abs(stated.from_unit[FRICTION]) == pytest.approx(TOLERANCE[FRICTION], rel=0.01)
    assert shown.from_unit == stated.from_unit
    _, longer, _ = sized(recorded(np.random.default_rng(1), 0.0, 16000), np.zeros(COUNT))
    assert longer.own == pytest.approx(stated.own / 2.0, rel=0.05)
    assert longer.shared == pytest.approx(stated.shared, rel=0.01)


def test_recordings_of_one_unit_scatter_by_the_own_error_and_are_off_by_the_shared_one() -> None:
    random = np.random.default_rng(5)
    runs = [sized(recorded(random, 6.0, 1000), np.zeros(COUNT)) for _ in range(60)]
    sizes = np.array([size for size, _, _ in runs])
    for own in (runs[0][1].own, float(np.mean([shown.own for _, _, shown in runs]))):
        assert float(sizes.std()) == pytest.approx(own, rel=0.25)
    assert float(sizes.mean()) == pytest.approx(14.0, abs=3.0 * runs[0][1].own / math.sqrt(60))


def test_what_recordings_of_a_unit_differ_by_is_no_part_of_what_they_share() -> None:
    pieces = recorded(np.random.default_rng(1), 0.0, 4000)
    share = np.zeros(COUNT)
    _, alone, _ = sized(pieces, share)
    share[FRICTION] = 0.36
    _, stated, _ = sized(pieces, share)
    assert stated.from_unit[FRICTION] == pytest.approx(0.8 * alone.from_unit[FRICTION])
    assert stated.total == pytest.approx(alone.total)
