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

"""Standard deviation and kurtosis of a block, against closed forms and against scipy."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from scipy import stats

from flea_diag.stages.extractor.condition_indicators import POINTS, condition_indicators
from flea_diag.wire.records import VibrationBlock

COUNT = 2000
NOISE = np.random.default_rng(3).standard_normal((200, COUNT, 2)).astype(np.float32)


def block(samples: npt.ArrayLike) -> VibrationBlock:
    samples = np.asarray(samples, np.float32)
    offsets = (np.arange(len(samples)) * 50_000).astype(np.uint32)
    axes = tuple("xyz"[: samples.shape[1]])
    return VibrationBlock.pack(0, axes, offsets, samples)


def test_both_are_those_of_the_points_that_stand_for_the_block() -> None:
    std, kurtosis = condition_indicators(block(NOISE[0]))
    points = NOISE[0][:: COUNT // POINTS].astype(float)
    np.testing.assert_allclose(std, points.std(axis=0), rtol=1e-5)
    np.testing.assert_allclose(kurtosis, stats.kurtosis(points, fisher=False), rtol=1e-5)
    few = block(NOISE[0][:100])
    np.testing.assert_allclose(condition_indicators(few)[0], NOISE[0][:100].std(axis=0), rtol=1e-5)


def test_on_noise_they_scatter_as_500_points_do() -> None:
    """Gaussian: 1 / sqrt(2 n) of the standard deviation, sqrt(24 / n) of the kurtosis."""
    std, kurtosis = np.array([condition_indicators(block(b)) for b in NOISE]).swapaxes(0, 1)
    assert std.mean(axis=0) == pytest.approx([1.0, 1.0], rel=0.01)
    assert std.std(axis=0) == pytest.approx([0.0316, 0.0316], rel=0.2)
    assert kurtosis.mean(axis=0) == pytest.approx([3.0, 3.0], rel=0.02)
    assert kurtosis.std(axis=0) == pytest.approx([0.219, 0.219], rel=0.3)


def test_a_gain_moves_the_level_alone_and_what_strikes_the_kurtosis() -> None:
    time = np.arange(COUNT) % 200
    rung = np.column_stack([3.0 * np.exp(-time / 20.0) * np.sin(time)] * 2)
    quiet, struck = block(0.5 * NOISE[1]), block(0.5 * NOISE[1] + rung)
    louder = block(2.0 * (0.5 * NOISE[1] + rung))
    found, noise = (np.array(condition_indicators(b)[1]) for b in (struck, quiet))
    assert (found > 1.5 * noise).all()
    np.testing.assert_allclose(
        condition_indicators(louder)[1], condition_indicators(struck)[1], rtol=1e-5
    )
    np.testing.assert_allclose(
        condition_indicators(louder)[0], 2.0 * np.array(condition_indicators(struck)[0]), rtol=1e-5
    )


def test_gravity_costs_no_digits_and_a_dead_axis_has_neither() -> None:
    low, high = block(1e-3 * NOISE[2]), block(9.81 + 1e-3 * NOISE[2])
    for one, other in zip(condition_indicators(low), condition_indicators(high), strict=True):
        np.testing.assert_allclose(one, other, rtol=5e-3)
    std, kurtosis = condition_indicators(block(np.zeros((COUNT, 2))))
    assert std == kurtosis == (0.0, 0.0)
