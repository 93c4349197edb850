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

"""Commands of control surfaces: what their tables say is what the stand is told to do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import welch

from flea_diag.errors import ConfigurationError
from flea_sim_driver.machine.library import find_machine
from flea_sim_driver.scenario.flight_profiles import FLIGHT_PROFILES, ROW_S, find_profile
from flea_sim_driver.scenario.flights import flights
from flea_sim_driver.scenario.library import find_scenario
from flea_sim_driver.scenario.scenario_file import (
    overridden,
    scenario_from_mapping,
    scenario_to_mapping,
)

LIMITS = find_machine("flea").limits


def test_there_are_twenty_which_the_stand_can_follow_and_each_says_whose_it_is() -> None:
    made = flights(7)
    assert len(made) == len({row.name for row in FLIGHT_PROFILES}) == 20
    assert all(row.source and row.shape for row in FLIGHT_PROFILES)
    for scenario in made:
        assert scenario.flight is not None
        start = scenario.flight.position_m[:2]
        assert start[0] == pytest.approx(0.05)
        assert abs(start[1] - start[0]) < 1e-5  # from rest


def test_a_3211_holds_each_level_for_its_units() -> None:
    flown = find_profile("elevator_3211").flight(LIMITS, 0)
    level = np.round((flown.position_m - 0.05) * 1e3, 2)
    held = [(1.9, 12.0), (3.9, -12.0), (5.1, 12.0), (5.8, -12.0), (8.0, 0.0), (15.9, 12.0)]
    for at_s, expected in held:
        assert level[round(at_s / ROW_S)] == expected, at_s
    crossings = ROW_S * np.flatnonzero(np.diff(np.sign(level[:400] + 1e-9)) != 0)
    np.testing.assert_allclose(np.diff(crossings[:3]), [1.4, 0.7], atol=0.1)


def test_a_gust_has_the_rms_of_its_table_and_falls_off_as_dryden_says() -> None:
    fast = replace(LIMITS, flight_speed_m_s=10.0, flight_acceleration_m_s2=100.0)
    path = find_profile("aileron_gust_severe").flight(fast, 3, 2000.0).position_m - 0.05
    assert path.std() == pytest.approx(0.008, rel=0.05)
    frequency, density = welch(path, 1.0 / ROW_S, nperseg=8192)
    corner = 1.0 / (2.0 * np.pi)
    low, at = (np.interp(f, frequency, density) for f in (0.03, 2.0 * corner))
    dryden = (1.0 + (0.03 / corner) ** 2) / (1.0 + 4.0)
    servo = 1.0 / (1.0 + (2.0 / 6.0) ** 2) ** 2
    assert at / low == pytest.approx(dryden * servo, rel=0.3)


def test_a_slower_machine_flies_the_same_shape_and_less_of_it() -> None:
    profile, wing = find_profile("spoiler_deployment"), find_machine("wing").limits
    paths = [
        row.position_m / limits.stroke_m - 0.5
        for limits in (LIMITS, wing)
        for row in (profile.flight(limits, 0),)
    ]
    share = paths[1].max() / paths[0].max()
    assert 0.1 < share < 1.0
    np.testing.assert_allclose(paths[1], share * paths[0], atol=1e-12)
    reached = np.abs(np.diff(paths[1])).max() * wing.stroke_m / ROW_S
    assert reached == pytest.approx(0.99 * wing.flight_speed_m_s)


def test_a_gust_is_drawn_by_the_seed_and_a_step_is_not() -> None:
    for name, same in (("cyclic_hover", False), ("aileron_doublet", True)):
        one, again, other = (find_profile(name).flight(LIMITS, k).position_m for k in (1, 1, 2))
        assert (one == again).all()
        assert (one == other).all() == same


def test_a_profile_is_a_scenario_by_its_name_and_comes_back_from_its_file() -> None:
    found = overridden(find_scenario("cyclic_hover"), "here", {"seed": 9, "duration_s": 20.0})
    assert found.flight is not None
    assert found.flight.duration_s == 20.0
    again = scenario_from_mapping(scenario_to_mapping(found), "again")
    assert again.flight is not None
    np.testing.assert_array_equal(again.flight.position_m, found.flight.position_m)
    assert find_scenario("cyclic_slalom", "ema").machine.name == "ema"


def test_what_no_row_has_is_refused() -> None:
    with pytest.raises(ConfigurationError, match=r"'aileron' is none of aileron_doublet, "):
        scenario_from_mapping({"motion": {"kind": "flight", "profile": "aileron"}}, "here")
