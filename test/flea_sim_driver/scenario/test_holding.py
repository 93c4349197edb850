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

"""The holding brake of a simulated axis: when it grips, and how the motion waits for it."""

from __future__ import annotations

import numpy as np
import pytest
from support.stand_runs import records, scans

from flea_diag.errors import ConfigurationError
from flea_sim_driver.scenario.holding import GRIPS_S, SLOWS_S, engaged, motion_time
from flea_sim_driver.scenario.settings import Brake

TWICE = Brake(first_s=4.0, for_s=2.0, every_s=10.0)
MOTION = {"kind": "sine", "amplitude_m": 0.25, "frequency_hz": 0.2, "centre_m": 0.6}
AXIS = {"machine": "axis", "motion": MOTION}


def test_it_is_engaged_every_so_often_and_grips_late() -> None:
    times = np.array([3.9, 4.0, 5.9, 6.0, 13.9, 14.1, 16.1])
    assert engaged(TWICE, times).tolist() == [False, True, True, False, False, True, False]
    assert engaged(TWICE, np.array([4.0, 4.01 + GRIPS_S]), GRIPS_S).tolist() == [False, True]
    assert not engaged(Brake(), times).any()


def test_the_motion_slows_down_stands_still_and_goes_on() -> None:
    step = 1e-3
    times = np.arange(0.0, 30.0, step)
    rate = np.gradient(motion_time(TWICE, times), step)
    still = engaged(TWICE, times) & engaged(TWICE, times - step) & engaged(TWICE, times + step)
    assert np.abs(rate[still]).max() < 1e-9
    assert rate.min() > -1e-9
    assert rate.max() < 1.0 + 1e-9
    # Smooth: no more acceleration of the time than the steepest smooth step has.
    assert np.abs(np.diff(rate)).max() < 1.5 / SLOWS_S * step * 1.01
    # Each time costs the time that it holds for and half of what it slows down and speeds up in.
    assert times[-1] - motion_time(TWICE, times)[-1] == pytest.approx(3 * (2.0 + SLOWS_S), abs=0.01)
    assert motion_time(Brake(for_s=3.0), np.zeros(1))[0] == 0.0


def test_a_weight_stands_under_the_brake_without_current_and_runs_after_it() -> None:
    run = scans(records(**AXIS, brake={"for_s": 2.0}, duration_s=8.0))
    held, free = slice(50, 200), slice(400, 800)
    assert set(run["brake_engaged"][held]) == {1.0}
    assert np.ptp(run["actuator_position"][held]) < 1e-5
    assert np.abs(run["motor_current"][held]).max() < 0.2
    assert set(run["brake_engaged"][free]) == {0.0}
    assert np.ptp(run["actuator_position"][free]) > 0.3
    # Carriage and payload of 13.4 kg by a force constant of 203 N/A.
    assert run["motor_current"][free].mean() == pytest.approx(13.4 * 9.81 / 203.0, rel=0.1)


def test_a_payload_weighs() -> None:
    light, heavy = (
        scans(records(**AXIS, load={"payload_kg": kg}, duration_s=6.0, unit_spread=0.0))
        for kg in (2.0, 10.0)
    )
    more = heavy["motor_current"][200:].mean() - light["motor_current"][200:].mean()
    assert more == pytest.approx(8.0 * 9.81 / 203.0, rel=0.1)


def test_a_supply_that_sags_shows_on_the_link() -> None:
    sag = {"fault": "supply_sag", "onset_s": 3.0, "size": 0.2}
    link = scans(records(**AXIS, faults=[sag], duration_s=6.0))["bus_voltage"]
    assert link[350:].mean() / link[:250].mean() == pytest.approx(0.8, abs=0.01)


@pytest.mark.parametrize(
    ("brake", "machine", "said"),
    [
        ({"for_s": 2.0}, "joint", "brake.for_s = 2.0 s, but joint has no brake"),
        ({"for_s": 5.0, "every_s": 6.0}, "axis", "brake.every_s = 6.0 s is less than 7 s"),
    ],
)
def test_a_brake_that_cannot_be_is_refused(brake: dict, machine: str, said: str) -> None:
    with pytest.raises(ConfigurationError, match=said):
        records(machine=machine, motion={"kind": "hold"}, brake=brake)


def test_a_payload_beyond_what_it_lifts_is_refused() -> None:
    with pytest.raises(
        ConfigurationError, match=r"payload_kg = 20.0 kg is above its limit 15.0 kg"
    ):
        records(**AXIS, load={"payload_kg": 20.0})
