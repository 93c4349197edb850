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

"""A voltage that current and motion contradict, and one that nothing corroborates."""

from __future__ import annotations

import numpy as np
import pytest
from support import stands
from support.observed import FLEA_COUNTS
from support.observer_scans import after, decisions, healthy, quality

from flea_diag.configuration import knowledge as of_stand
from flea_diag.configuration.description import compiled_relations
from flea_diag.core.residual_values import ResidualRows
from flea_diag.core.residuals.parameters import UNIT_PARAMETERS
from flea_diag.stages.observer.observer import ObserverStage
from flea_diag.stages.observer.observer_parameters import ObserverParameters
from flea_diag.stages.observer.voltage_trust import VoltageTrust
from flea_diag.wire.records import DataQuality, Detection, Quality, Residual

FLEA = compiled_relations("actuator.yaml").residuals

LIMIT_V = 5.0


@pytest.mark.parametrize(
    ("volts", "until"),
    [(-24.0, 1000), (11.0, 900)],
    ids=["beyond what a fault explains", "held 3 V from the truth"],
)
def test_a_bad_voltage_is_no_fault_and_is_named(volts, until):
    spoilt = [
        after(s, motor_voltage=volts) if 800 <= k < until else s for k, s in enumerate(healthy())
    ]
    out = stands.replay(stands.observer(), spoilt)
    assert decisions(out) == []
    found = [quality(r, "motor_voltage") for r in stands.of(DataQuality, out)][:3]
    assert [row.quality for row in found] == [Quality.GOOD, Quality.GOOD, Quality.BAD]
    assert "disagrees with current and motion" in found[-1].reason
    start_s = (found[-1].since_ns - spoilt[0].stamp_ns) / 1e9
    assert start_s == pytest.approx(8.2, abs=0.3)


def sampled(sampling: str) -> ObserverStage:
    """An observer of a stand without a command, whose voltage is sampled so."""
    known = stands.calibration(sampling=sampling)
    return ObserverStage(known, of_stand.effects(stands.STAND, known), ObserverParameters())


def test_the_zero_of_a_mean_voltage_is_that_of_its_sensor():
    """No command stands beside it, and none is needed: the same reading twice tells no more."""
    at = healthy()[0].channels.index("motor_voltage")
    faulty = [
        after(s, motor_voltage=s.values[at] + 3.4) if k >= 1200 else s
        for k, s in enumerate(healthy())
    ]
    found = decisions(stands.replay(sampled("mean"), faulty))
    assert found[0].residual == "parity_electrical"


@pytest.mark.in_turn(2)
@pytest.mark.slow
def test_the_zero_of_a_voltage_that_nothing_corroborates_is_no_symptom():
    at = healthy()[0].channels.index("motor_voltage")
    faulty = [
        after(s, motor_voltage=s.values[at] + 3.4) if k >= 1200 else s
        for k, s in enumerate(healthy())
    ]
    out = stands.replay(sampled("instant_pwm"), faulty)
    assert not [d for d in stands.of(Detection, out) if d.residual == "parity_electrical"]
    # The residual itself is there for whoever looks.
    last = stands.of(Residual, out)[-1]
    assert last.values[last.names.index("parity_electrical")] == pytest.approx(3.4, abs=0.5)


def electrical(volts: list[float]) -> ResidualRows:
    """Residuals of scans in which the electrical relation is off by so many volts."""
    values = np.zeros((len(volts), len(FLEA.rows)))
    values[:, FLEA.place["parity_electrical"]] = volts
    still = np.zeros(len(volts), dtype=bool)
    spread = np.zeros((len(volts), len(FLEA.spreading), len(UNIT_PARAMETERS)))
    nothing = np.zeros((len(volts), 2))
    return ResidualRows(values, spread, nothing, nothing, still)


def test_a_voltage_loses_trust_with_the_twentieth_implausible_scan_in_a_row():
    rows = electrical([0.0] * 5 + [9.0] * 30)
    trust = VoltageTrust(FLEA, LIMIT_V, FLEA_COUNTS)
    verdict = trust.judge(rows, np.ones(35, dtype=bool))
    assert verdict.lost_at == 5 + 20 - 1
    assert trust.lost
    assert verdict.usable.tolist() == [True] * 5 + [False] * 30
    assert verdict.trusted.tolist() == [True] * 25 + [False] * 10
    verdict.leave_out(rows)
    needs = [j for j, row in enumerate(FLEA.rows) if "motor_voltage" in row.needs]
    assert np.isnan(rows.values[5:, needs]).all()
    assert not np.isnan(rows.values[:5]).any()
    assert not np.isnan(np.delete(rows.values, needs, axis=1)).any()


def test_a_voltage_that_a_command_corroborates_is_not_judged():
    trust = VoltageTrust(FLEA, LIMIT_V, FLEA_COUNTS)
    verdict = trust.judge(electrical([9.0] * 30), np.zeros(30, dtype=bool))
    assert verdict.usable.all()
    assert verdict.trusted.all()
    assert (verdict.lost_at, trust.lost) == (30, False)
