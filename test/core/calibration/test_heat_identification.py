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

"""Heating and cooling from rows whose truth is known, and their covariance against repetition."""

from __future__ import annotations

import math

import numpy as np
import pytest
from support.observed import flea_parameters

from flea_diag.configuration.description import compiled_relations
from flea_diag.core.calibration.calibration import NominalRun
from flea_diag.core.calibration.heat_identification import NominalSignals, identify
from flea_diag.core.calibration.identified import Identified

FLEA = compiled_relations("actuator.yaml").residuals

RELATIONS = compiled_relations("actuator.yaml", has_encoder=False)
HEATING, COOLING_S, AIR = 0.010, 600.0, 24.0


def run(number: int, draw: np.random.Generator, scans: int = 2000) -> NominalRun:
    """A motor at another temperature and under another current in each run, exactly by its law."""
    current, start = 1.0 + 0.4 * number, AIR + 3.0 * ((5 * number) % 7)
    end = AIR + HEATING * current**2 * COOLING_S
    time_s = 0.01 * np.arange(scans)
    rows = np.full((scans, len(FLEA.channels)), np.nan)
    rows[:, FLEA.index["motor_current"]] = current
    rows[:, FLEA.index["motor_temperature"]] = (
        end + (start - end) * np.exp(-time_s / COOLING_S) + 0.4 * draw.standard_normal(scans)
    )
    rows[:, FLEA.index["ambient_temperature"]] = AIR
    rows[:, FLEA.index["actuator_position"]] = 0.05
    return NominalRun(f"run{number}", rows)


def fitted(seed: int, count: int = 12, scans: int = 2000) -> Identified:
    draw = np.random.default_rng(seed)
    return identified([run(n, draw, scans) for n in range(count)])


def identified(runs: list[NominalRun]) -> Identified:
    """Heating and cooling from runs under a constant current, which needs no smoothing."""
    result = Identified(flea_parameters())
    rows = np.concatenate([made.rows for made in runs])
    columns = {
        name: rows[:, FLEA.index[name]] if name in FLEA.index else np.zeros(len(rows))
        for name in RELATIONS.signals
    }
    number = np.repeat(np.arange(len(runs)), [len(made.rows) for made in runs])
    identify(runs, 0.01, RELATIONS, NominalSignals(columns, number), result)
    return result


@pytest.fixture(scope="module")
def repeated() -> list[Identified]:
    return [fitted(seed) for seed in range(40)]


def test_heating_and_cooling_are_found(repeated):
    heat = [r.parameters.motor_heating_k_per_a2s for r in repeated]
    tau = [r.parameters.motor_cooling_s for r in repeated]
    assert np.mean(heat) == pytest.approx(HEATING, rel=0.03)
    assert np.median(tau) == pytest.approx(COOLING_S, rel=0.1)


def test_their_covariance_is_the_scatter_of_repeated_experiments(repeated):
    pairs = np.array(
        [
            (r.parameters.motor_heating_k_per_a2s, 1.0 / r.parameters.motor_cooling_s)
            for r in repeated
        ]
    )
    block = repeated[0].covariance[0]
    assert block.parameters == ("motor_heating_k_per_a2s", "motor_cooling_s")
    for r in repeated:
        assert r.sigmas["motor_cooling_s"] == math.sqrt(r.covariance[0].matrix[1][1])
    told = np.median([r.sigmas["motor_heating_k_per_a2s"] for r in repeated])
    assert told == pytest.approx(pairs[:, 0].std(), rel=0.5)
    told = np.median(
        [r.sigmas["motor_cooling_s"] / r.parameters.motor_cooling_s**2 for r in repeated]
    )
    assert told == pytest.approx(pairs[:, 1].std(), rel=0.5)
    # More heating and faster cooling make up for each other: 1/tau and h rise together.
    assert np.corrcoef(pairs.T)[0, 1] > 0.5
    assert all(r.covariance[0].matrix[0][1] < 0.0 for r in repeated)


def test_too_few_recordings_are_named():
    result = fitted(1, count=3)
    assert "3 recordings with motor_temperature" in result.not_identified["motor_cooling_s"]
    assert result.covariance == []


def test_what_cannot_cool_keeps_its_default_and_heating_still_has_an_error():
    draw = np.random.default_rng(1)
    runs = []
    for number in range(6):
        made = run(number, draw)
        warmer = 0.01 * number * 0.01 * np.arange(len(made.rows))
        made.rows[:, FLEA.index["motor_temperature"]] = (
            AIR + 2.0 * number + warmer + 0.4 * draw.standard_normal(len(made.rows))
        )
        runs.append(made)
    result = identified(runs)
    assert result.not_identified["motor_cooling_s"] == "no cooling within the recordings"
    assert result.sigmas["motor_heating_k_per_a2s"] > 0.0
