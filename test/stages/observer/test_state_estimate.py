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

"""The state observer inside the observer stage: what goes out, what detects, what stays put."""

from __future__ import annotations

import importlib.util
import math
from dataclasses import replace

import numpy as np
import pytest
from support import stands
from support.models import linear_ema as ema

from flea_diag.configuration.description import compiled_relations
from flea_diag.core.residuals.parameters import UNIT_PARAMETERS
from flea_diag.stages.observer.state_estimate import StateEstimate
from flea_diag.wire.records import Detection, Outcome, Residual, Scan, Symbols

FLEA = compiled_relations("actuator.yaml").residuals

BACKENDS = ["numpy", *(["numba"] if importlib.util.find_spec("numba") else [])]


def healthy(seconds: float = 12.0, seed: int = 70) -> list[Scan]:
    return stands.scans(ema.noisy(ema.run(seconds=seconds), seed))


def jammed() -> list[Scan]:
    worse = ema.changed(coulomb=200.0, viscous=1500.0)
    return stands.scans(ema.noisy(ema.run(seconds=14.0, faulty=worse, onset_s=10.0), 71))


def residuals(scans, **parameters) -> list[Residual]:
    return stands.of(Residual, stands.replay(stands.observer(**parameters), scans))


@pytest.mark.parametrize("kind", ["particle", "kalman"])
def test_readings_lie_in_the_band_of_the_estimate_as_often_as_sigma_says(kind):
    scans = healthy()
    told = residuals(scans, state_observer=kind)[200:]
    channels = told[0].estimated
    assert {"motor_current", "actuator_position", "motor_temperature"} <= set(channels)
    for name in ("motor_current", "actuator_position"):
        k, at = channels.index(name), scans[0].channels.index(name)
        y = np.array([scan.values[at] for scan in scans[200:]])
        off = np.abs(y - [r.estimates[k] for r in told])
        inside = np.mean(off < 2.0 * np.array([r.estimate_sigmas[k] for r in told]))
        assert 0.88 < inside <= 1.0, name
    ess, nis, diverged = np.array([r.health for r in told]).T
    assert (diverged == 0.0).all()
    assert 0.5 < nis.mean() < 2.0
    assert (ess == math.inf).all() if kind == "kalman" else (ess <= 200.0).all()


@pytest.mark.slow
def test_what_is_told_has_the_same_bits_compiled():
    """The Kalman filter itself is not compiled; an episode freezes it."""
    pytest.importorskip("numba")
    one, other = (
        residuals(jammed(), state_observer="kalman", observer_backend=backend)
        for backend in ("numpy", "numba")
    )
    assert repr(one) == repr(other)


def test_without_a_state_observer_the_relations_stay_as_they_are():
    scans = jammed()
    bare, full = residuals(scans, state_observer="none"), residuals(scans)
    assert bare[-1].estimated == bare[-1].health == ()
    for one, other in zip(bare, full, strict=True):
        for name, a, b in zip(one.names, one.values, other.values, strict=True):
            if name.startswith("innovation"):
                assert math.isnan(a)
            elif name.startswith("parity"):
                assert a == b or (math.isnan(a) and math.isnan(b))


def test_equal_seeds_give_equal_records_and_another_seed_others():
    scans = healthy(4.0)
    one, two = residuals(scans), residuals(scans)
    assert repr(one) == repr(two)
    assert repr(residuals(scans, observer_seed=2)) != repr(one)


@pytest.mark.parametrize("backend", BACKENDS)
def test_backends_agree_on_the_estimate(backend):
    scans = healthy(4.0)
    one = residuals(scans, observer_backend="numpy")[-1]
    other = residuals(scans, observer_backend=backend)[-1]
    np.testing.assert_allclose(other.estimates, one.estimates, rtol=1e-6, atol=1e-9)


@pytest.mark.slow
def test_a_jam_turns_the_innovation_against_the_motion():
    """More drag than foretold: the motor is slower than the filter, whichever way it goes."""
    table = np.array([innovations(r) for r in open_loop(jammed())])
    dn = list(FLEA.innovations).index("innovation_actuator_position_dn")
    nominal, faulty = table[300:1000, dn], table[1010:, dn]
    assert np.nanmean(faulty) < -3.0 * abs(np.nanmean(nominal))


def open_loop(scans) -> np.ndarray:
    """Rows of FLEA.channels with the command that corroborates the voltage."""
    out = np.full((len(scans), len(FLEA.channels)), np.nan)
    for k, scan in enumerate(scans):
        for name, value in zip(scan.channels, scan.values, strict=True):
            if name in FLEA.channels:
                out[k, FLEA.channels.index(name)] = value
    out[:, FLEA.channels.index("commanded_voltage")] = out[:, FLEA.channels.index("motor_voltage")]
    return out


USABLE = np.ones(1, dtype=bool)
ESTIMATES: dict[int, StateEstimate] = {}


def innovations(row: np.ndarray) -> list[float]:
    estimate = ESTIMATES.setdefault(
        0, StateEstimate(stands.calibration(), stands.relations(), "particle", 1, "numpy")
    )
    values = np.full((1, len(FLEA.rows)), np.nan)
    estimate.step(row[None], USABLE, False, values)
    return values[0, FLEA.innovation_columns].tolist()


def test_innovations_are_silent_once_frozen_and_begin_anew_afterwards():
    estimate = StateEstimate(stands.calibration(), stands.relations(), "kalman", 1, "numpy")
    values = np.full((1, len(FLEA.rows)), np.nan)
    table = open_loop(healthy(6.0))
    for k, row in enumerate(table):
        told = estimate.step(row[None], USABLE, 200 <= k < 300, values)
        seen = np.isfinite(values[0, FLEA.innovation_columns])
        # The scan that a filter starts from has no prediction to be held against.
        assert seen[0] == (k not in (0, *range(200, 301)))
        assert told.estimates.shape == (1, len(told.channels))
    assert told.health[0, 2] == 0.0


def test_a_track_lost_to_a_fault_is_not_told_of_while_frozen():
    """Else the lost track would grow as old as the episode, and its end be a model mismatch."""
    estimate = StateEstimate(stands.calibration(), stands.relations(), "kalman", 1, "numpy")
    values = np.full((1, len(FLEA.rows)), np.nan)
    table = open_loop(healthy(8.0))
    table[400:, FLEA.channels.index("actuator_position")] += 0.02
    lost = [
        estimate.step(row[None], USABLE, 500 <= k < 700, values).health[0, 2]
        for k, row in enumerate(table)
    ]
    assert any(lost[400:500])
    assert not any(lost[:400])
    assert not any(lost[500:700])
    assert not any(lost[700:])  # it begins anew, at what is measured


def test_a_voltage_that_nothing_corroborates_tests_nothing():
    estimate = StateEstimate(stands.calibration(), stands.relations(), "kalman", 1, "numpy")
    values = np.full((1, len(FLEA.rows)), np.nan)
    table = open_loop(healthy(2.0))
    table[:, FLEA.channels.index("commanded_voltage")] = np.nan
    for row in table:
        estimate.step(row[None], USABLE, False, values)
        assert np.isnan(values[:, FLEA.innovation_columns]).all()


def test_innovations_detect_but_make_no_symbol():
    out = stands.replay(stands.observer(), jammed())
    assert stands.of(Detection, out)
    for record in stands.of(Symbols, out):
        assert not any(s.residual.startswith("innovation") for s in record.symbols)
    assert all(not row.isolates for row in FLEA.rows if row.name.startswith("innovation"))
    assert len(FLEA.innovations) == 2 * len(FLEA.innovated)


def test_another_unit_moves_innovations_as_far_as_the_calibration_foretells():
    """The rms that ``unit_spread`` measured against a unit simulated with that parameter."""
    calibration = stands.calibration()
    limit = calibration.limit("innovation_motor_current_dn")
    assert limit is not None
    assert len(limit.spread) == len(UNIT_PARAMETERS)
    assert all(value >= 0.0 for value in limit.spread)
    # Friction loads the motor one way only: the direction-normalised row feels it most.
    assert limit.spread[0] > 0.0


def test_a_lost_track_that_no_relation_explains_is_a_model_mismatch():
    stage, lost = stands.isolator(), []
    scans = healthy(8.0)
    for record in stands.replay(stands.observer(), [stands.table(), *scans]):
        if isinstance(record, Residual):
            health = (150.0, 40.0, float(record.stamp_ns - scans[0].stamp_ns > 2_000_000_000))
            record = replace(record, health=health)
        lost += stage.handle(record)
    lost += stage.finish()
    groups = [record.outcome for record in lost]
    assert groups[-1] is Outcome.MODEL_MISMATCH
    assert "state observer diverged" in lost[-1].words
