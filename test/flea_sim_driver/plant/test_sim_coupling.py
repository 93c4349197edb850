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

"""The electromagnet of the coupling: how its pull rises, and what the load path does until then."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from flea_sim_driver.scenario.holding import magnet_holds_n
from flea_sim_driver.scenario.scenario_file import scenario_from_mapping
from flea_sim_driver.scenario.settings import Switch
from flea_sim_driver.stand import SimulatedStand

Array = npt.NDArray[np.float64]
AT_S = 5.0


def test_the_pull_rises_with_the_square_of_the_current_of_a_coil() -> None:
    switch = Switch(at_s=AT_S, magnet_s=0.1, magnet_n=1000.0)
    since = np.array([-0.01, 0.0, 0.1, 0.3, 2.0])
    current = 1.0 - np.exp(-since / 0.1)
    expected = [np.inf, *(1000.0 * current[1:4] ** 2), np.inf]
    np.testing.assert_allclose(magnet_holds_n(switch, AT_S + since), expected)
    assert np.isinf(magnet_holds_n(Switch(at_s=AT_S), AT_S + since)).all()
    assert np.isinf(magnet_holds_n(Switch(magnet_s=0.1), AT_S + since)).all()


def force_and_gap(**switch: Any) -> tuple[Array, Array]:
    """Force of the coupling, and gap between nut and load side, from the engagement on."""
    scenario = scenario_from_mapping(
        {
            "seed": 3, "duration_s": 8.0, "sensors": {"vibration": False},
            "motion": {"kind": "sine", "amplitude_m": 0.0218, "frequency_hz": 0.5,
                       "centre_m": 0.045},
            "load": {"constant_n": -200.0}, "switch": {"at_s": AT_S, "to": "Y", **switch},
        },
        "coupling",
    )  # fmt: skip
    stand, force, gap = SimulatedStand(scenario), [], []
    while not stand.finished:
        stand.advance()
        assert stand.block is not None
        force.append(stand.block.column("force"))
        gap.append(stand.block.column("position") - stand.block.column("load_position"))
    cut = slice(round(AT_S / 0.5e-3), None)
    return np.concatenate(force)[cut], np.concatenate(gap)[cut]


def test_a_weak_magnet_pulls_no_more_than_it_can_and_the_gap_closes_once_it_holds() -> None:
    held, closed = force_and_gap()
    force, gap = force_and_gap(magnet_s=0.2)
    since = np.arange(len(force)) * 0.5e-3
    pull = magnet_holds_n(Switch(at_s=AT_S, magnet_s=0.2), AT_S + since)
    scans = pull[::20].repeat(20)[: len(force)]  # the pull of a scan is that at its start
    assert (force >= -scans - 1e-3).all()
    assert np.abs(gap - closed)[since < 0.3].max() > 1e-4
    late = since > 2.4
    assert np.abs(gap - closed)[late].max() < 1e-4
    assert force[late].mean() == pytest.approx(held[late].mean(), abs=10.0)
