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

"""Sizes that a calibration can see, against closed forms and against injections."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm
from support.models.law_design import COLUMNS, FAULTS, RELATIONS, recording, recordings

from flea_diag.core.run_law.law_learning import learn_law
from flea_diag.core.run_law.run_law import FeignedSize, LawTerm, RelationNoise, RunLaw
from flea_diag.core.run_law.visible_sizes import WIDE, limit_nats, size_along, visible_sizes

LIMIT, DROP = 8.0, 3.5


def exact(run_sigma: float) -> RunLaw:
    """A law with white noise of 0.2, its mean known."""
    terms = (LawTerm("drag", "unit", 0.0, run_sigma), LawTerm("zero", "free", 0.0, run_sigma))
    noise = tuple(RelationNoise(name, 0.2, 0.0, 0.3) for name in RELATIONS)
    feigned = tuple(FeignedSize(c.fault, c.size, 0.0, 0.0) for c in FAULTS.columns)
    return RunLaw(terms, noise, ((0.0,), (0.0, 0.0)), 9, 1, 1e4, None, feigned)


def test_of_recordings_that_do_not_differ_the_size_is_that_of_a_known_signal_in_noise():
    run = recording(np.random.default_rng(1), (0.0, 0.0), windows=300)
    jam, bias = visible_sizes(exact(1e-6), COLUMNS, FAULTS, [run], LIMIT, DROP)
    x = run.signals[:, 0, 2]
    # In standard errors, of a size that may be ten times as large; what it might be costs evidence.
    guess = np.sqrt(2 * LIMIT)
    spent = 0.5 * np.log(1.0 + (WIDE * guess) ** 2)
    shown = np.sqrt(2 * (LIMIT + spent)) * 0.2
    assert jam.before == pytest.approx(shown / np.sqrt((x**2).sum()), rel=1e-3)
    # 50 windows, 10 s, follow the onset; from -9 to 9 V are possible.
    spent = 0.5 * np.log(1.0 + 18.0**2 / 12.0 / 0.2**2 * 50)
    shown = np.sqrt(2 * (LIMIT + spent)) * 0.2
    assert bias.onset == pytest.approx(shown / np.sqrt(50), rel=1e-3)


def test_a_fault_from_before_is_held_against_what_recordings_differ_by():
    run = recording(np.random.default_rng(2), (0.0, 0.0), windows=3000)
    jam, _ = visible_sizes(exact(0.5), COLUMNS, FAULTS, [run], LIMIT, DROP)
    spent = 0.5 * np.log(1.0 + WIDE**2 * 2 * LIMIT)
    assert jam.before == pytest.approx(np.sqrt(2 * (LIMIT + spent)) * 0.5, rel=0.02)
    assert jam.onset < 0.2 * jam.before


def test_faults_of_the_same_effect_are_named_as_not_told_apart():
    same = replace(FAULTS, design=FAULTS.design[..., [0, 0]])
    run = recording(np.random.default_rng(3), (0.0, 0.0))
    jam, other = visible_sizes(exact(0.1), COLUMNS, same, [run], LIMIT, DROP)
    assert (jam.alike, other.alike) == (("circuit_bias",), ("jam",))


@pytest.mark.slow
def test_half_of_injections_of_the_stated_size_reach_the_limit():
    rng = np.random.default_rng(4)
    fit = learn_law(recordings(rng, 40), COLUMNS, FAULTS, ())
    _, bias = visible_sizes(fit.law, COLUMNS, FAULTS, fit.sound, LIMIT, DROP)
    spread, feigned = fit.law.spread(), fit.law.feigned[1].claim_sigma
    reached = 0
    for run in recordings(rng, 200):
        values = run.values + bias.before * FAULTS.of(run)[..., 1]
        white = fit.law.law_noise.whitened(replace(run, values=values), np.concatenate(
            (COLUMNS.of(run), FAULTS.of(run)), axis=-1))  # fmt: skip
        rows = white.rows.reshape(-1, 5)
        gram, cross = rows[:, 1:].T @ rows[:, 1:], rows[:, 1:].T @ rows[:, 0]
        total = np.diag(spread.variance) + spread.covariance
        kept = np.linalg.inv(np.linalg.inv(total) + gram[:2, :2])
        cross = cross - gram[:, :2] @ spread.mean
        gain = gram[3, 3] - gram[3, :2] @ kept @ gram[:2, 3]
        pull = cross[3] - gram[3, :2] @ kept @ cross[:2]
        size, error = pull / gain, gain**-0.5
        # A size of the fault against one that healthy recordings feign.
        possible, healthy = (
            norm.logpdf(size, scale=np.hypot(error, scale)) for scale in (18.0 / 12**0.5, feigned)
        )
        reached += possible - healthy > LIMIT and size > 0.0
    assert reached / 200 == pytest.approx(0.5, abs=0.12)


def test_noise_that_is_louder_hides_more():
    run = recording(np.random.default_rng(6), (0.0, 0.0), windows=300)
    plain, loud = (
        visible_sizes(exact(1e-6), COLUMNS, FAULTS, [run], LIMIT, DROP, each)
        for each in (None, lambda signals: np.tile([2.0, 1.0], (len(signals), 1)))
    )
    assert loud[0].onset == pytest.approx(2.0 * plain[0].onset)
    assert loud[1].onset == pytest.approx(plain[1].onset)


def test_sizes_of_one_fault_show_along_their_way():
    way, none = np.array([3.0, 4.0]), np.zeros(2)
    both = size_along(np.diag([4.0, 9.0]), none, none, way, LIMIT)
    assert both == pytest.approx(np.sqrt(2 * LIMIT / (9 * 4 + 16 * 9)))
    feigned = size_along(np.diag([4.0, 9.0]), none, np.array([1.0, 0.0]), way, 0.0)
    assert feigned == 0.0
    assert size_along(np.zeros((2, 2)), none, none, way, LIMIT) == np.inf


def test_a_limit_grows_by_the_logarithm_of_what_is_tested():
    assert limit_nats(0.1, 10) - limit_nats(1.0, 10) == pytest.approx(np.log(10.0))
    assert limit_nats(0.1, 100) - limit_nats(0.1, 10) == pytest.approx(np.log(10.0))


def test_an_error_that_a_prediction_starts_from_does_not_show_from_before():
    run = recording(np.random.default_rng(5), (0.0, 0.0), windows=300)
    starting = replace(FAULTS, starting=(RELATIONS.index("circuit"),))
    jam, bias = visible_sizes(exact(0.1), COLUMNS, starting, [run], LIMIT, DROP)
    assert np.isfinite([jam.onset, jam.before, bias.onset]).all()
    assert np.isinf(bias.before)
