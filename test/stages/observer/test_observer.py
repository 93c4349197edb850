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

from itertools import pairwise

import numpy as np
import pytest
from support import stands
from support.models import linear_ema as ema
from support.observer_scans import after, decisions, healthy, jammed

from flea_diag.wire.records import Detection, Residual, Symbols

S = 1_000_000_000


@pytest.mark.slow
def test_a_healthy_actuator_is_quiet_and_every_scan_has_its_residuals():
    out = stands.replay(stands.observer(), [stands.table(), *healthy()])
    assert decisions(out) == []
    residuals = stands.of(Residual, out)
    assert [r.stamp_ns for r in residuals] == [s.stamp_ns for s in healthy()]
    # The first quality, the offsets once learned, and at the end what was judged.
    assert len(out) == len(residuals) + 3
    last = residuals[-1]
    assert len(last.names) == len(last.values) == len(last.z) == len(last.thresholds)
    assert len(last.regressor_names) == len(last.regressors)
    assert last.regressor_names[-1] == "moving"


@pytest.mark.slow
def test_a_jam_is_detected_within_a_second_and_never_before():
    out = stands.replay(stands.observer(), jammed())
    (detection,) = stands.of(Detection, out)
    delay_s = (detection.stamp_ns - jammed()[0].stamp_ns) / 1e9 - 10.0
    assert 0.0 < delay_s < 1.5
    assert detection.detected
    assert detection.residual.startswith(("parity_mechanical", "innovation_"))
    assert abs(detection.z) > detection.threshold
    symbols = stands.of(Symbols, out)
    assert symbols[0].stamp_ns >= detection.stamp_ns
    seen = {symbol.residual: symbol.magnitude for symbol in symbols[-1].symbols}
    assert seen["parity_mechanical_dn"] == "+"
    assert symbols[0].symbols[0].slope == "?"
    # Symbols never leave an episode and never change sign.
    for earlier, later in pairwise(symbols):
        for one, other in zip(earlier.symbols, later.symbols, strict=False):
            assert (one.residual, one.magnitude) == (other.residual, other.magnitude)


@pytest.mark.slow
def test_the_same_scans_give_the_same_records():
    one, two = (stands.replay(stands.observer(), jammed()) for _ in range(2))
    assert repr(one) == repr(two)


@pytest.mark.parametrize(
    ("channel", "error", "residual"),
    [
        ("motor_current", 0.6, "parity_mechanical"),
        ("load_force", 120.0, "parity_mechanical"),
        ("motor_temperature", 6.0, "motor_temperature"),
        ("nut_temperature", 8.0, "nut_temperature"),
        ("ambient_temperature", 5.0, "ambient_temperature"),
        ("actuator_position", 0.005, "actuator_position"),
    ],
)
def test_a_biased_sensor_is_detected_by_its_own_residuals(channel, error, residual):
    at = healthy()[0].channels.index(channel)
    faulty = [
        after(s, **{channel: s.values[at] + error}) if k >= 1200 else s
        for k, s in enumerate(healthy())
    ]
    out = stands.replay(stands.observer(), faulty)
    (detection,) = stands.of(Detection, out)
    assert detection.residual.startswith(residual)
    assert 0.0 < (detection.stamp_ns - faulty[1200].stamp_ns) / 1e9 < 2.5


@pytest.mark.slow
def test_reset_closes_the_episode_and_arms_again():
    stage = stands.observer()
    assert stage.reset() == ()
    stands.replay(stage, jammed()[:1500])
    (closed,) = stage.reset()
    assert isinstance(closed, Detection)
    assert (closed.detected, closed.episode, closed.test) == (False, 1, "reset")
    assert stage.reset() == ()
    found = stands.of(Detection, stands.replay(stage, jammed()[1500:]))
    assert [(d.detected, d.episode) for d in found] == [(True, 2)]


@pytest.mark.slow
def test_an_episode_ends_by_itself_once_all_is_quiet():
    columns = ema.noisy(ema.run(seconds=24.0), 52)
    biased = columns["motor_current"].copy()
    biased[1000:1300] += 1.0
    columns["motor_current"] = biased
    out = stands.replay(stands.observer(rearm_after_s=3.0), stands.scans(columns))
    found = stands.of(Detection, out)
    assert [(d.detected, d.episode) for d in found] == [(True, 1), (False, 1)]
    assert found[1].test == "quiet"
    assert found[1].stamp_ns >= stands.START_NS + 16 * S  # the bias went at 13 s
    stays = stands.of(
        Detection, stands.replay(stands.observer(rearm_after_s=0.0), stands.scans(columns))
    )
    assert [d.detected for d in stays] == [True]


def test_at_rest_nothing_is_called():
    still = ema.noisy(ema.run(seconds=12.0, reference=lambda t: 0.0), 53)
    out = stands.replay(stands.observer(), stands.scans(still))
    assert decisions(out) == []
    assert np.isnan(stands.of(Residual, out)[-1].z[0])


@pytest.mark.in_turn(2)
@pytest.mark.slow
def test_with_encoder_and_command_a_position_fault_stays_in_its_own_residuals():
    columns = ema.noisy(ema.run(seconds=16.0), 54)
    columns["actuator_position"] = columns["actuator_position"].copy()
    columns["actuator_position"][1000:] += 0.004
    out = stands.replay(stands.observer(ema.CHANNELS), stands.scans(columns, ema.CHANNELS))
    assert len([d for d in stands.of(Detection, out) if d.detected]) == 1
    seen = {symbol.residual for symbol in stands.of(Symbols, out)[-1].symbols}
    assert "parity_kinematic" in seen
    assert seen <= {"parity_kinematic", "actuator_position", "actuator_position_noise",
                    "parity_speed"}  # fmt: skip
