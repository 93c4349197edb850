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

"""Filters side by side against each of them alone."""

from __future__ import annotations

import copy
import math

import numpy as np
import pytest
from support.observed import NOISE, P, recording

from flea_diag.configuration.description import compiled_relations
from flea_diag.core.observers.kalman import KalmanFilter
from flea_diag.core.observers.kalman_bank import KalmanBank
from flea_diag.core.observers.observer_block import ReadingColumns, Scans
from flea_diag.core.observers.state_observer import StateObserver

RELATIONS = compiled_relations("actuator.yaml")
LEVELS = (NOISE, NOISE.scaled("force_n", 4.0), NOISE.scaled("voltage_v", 0.5))
COUNT, WARMER_AT = 80, 50


def begun(rows: np.ndarray, sampling: str) -> list[StateObserver]:
    """Kalman filters at all levels after the first scan."""
    options = {"voltage_sampling": sampling, "kind": "kalman"}
    draw = np.random.default_rng(0)
    found = [StateObserver(P, RELATIONS, 0.01, draw, noise=each, **options) for each in LEVELS]
    for each in found:
        each.follow(rows[:1])
    return found


@pytest.mark.parametrize("sampling", ["mean", "instant_pwm"])
def test_many_at_once_tell_what_each_tells_alone(sampling: str) -> None:
    """Two stretches: in one channels and inputs are missing, the other one's winding warms."""
    stretches = [recording(COUNT).copy(), recording(COUNT, seed=4)]
    index = RELATIONS.residuals.index
    for name, first, last in (
        ("motor_current", 5, 9),
        ("load_force", 20, 60),
        ("motor_voltage", 30, 40),
    ):
        stretches[0][first:last, index[name]] = math.nan
    observers = [begun(rows, sampling) for rows in stretches]
    models = [[each.model for each in row] for row in observers]
    filters = [[copy.deepcopy(each.tracking) for each in row] for row in observers]
    assert all(isinstance(each, KalmanFilter) for row in filters for each in row)
    bank = KalmanBank(filters, models)
    columns = ReadingColumns.of(RELATIONS.residuals, models[0][0].equations.channels)
    read = [
        Scans.read(rows, columns, row[0].absent, row[0].command, row[0].driving)
        for rows, row in zip(stretches, models, strict=True)
    ]
    for k in range(1, COUNT):
        if k == WARMER_AT:
            warm = [each.warmed(60.0) for each in models[1]]
            bank.adopt(1, warm)
            for each, model in zip(filters[1], warm, strict=True):
                each.adopt(model)
        nis, sigma = bank.step(*(np.array([getattr(each, n)[k] for each in read]) for n in "uy"))
        for s, row in enumerate(filters):
            for n, each in enumerate(row):
                each.predict(read[s].u[k])
                told = each.update(read[s].y[k])
                assert nis[s, n] == pytest.approx(told.nis, rel=1e-6, abs=1e-9)
                np.testing.assert_allclose(sigma[s, n], told.sigma, rtol=1e-6)
