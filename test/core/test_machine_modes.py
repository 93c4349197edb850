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

"""Modes scan by scan: worked by hand, and the same in blocks of any size."""

from __future__ import annotations

import numpy as np
import pytest

from flea_diag.core.machine_modes import IN, OUT, UNKNOWN, MachineModes, ModeRow

NAN = float("nan")
BRAKED = ModeRow("braked", 1, 0.5, NAN, 0.02, (0, 3), (2,), True, False)
READ = [0, 0, 0, 1, 1, 0, 0, 0, 0, 0, 0, NAN, 0, 0]
"""Engaged in scans 3 and 4, not read in scan 11."""


def taken(cuts: list[int]) -> tuple[list[int], dict[tuple[int, ...], list[int]]]:
    """States of all scans, and in which of them columns have no value; a kernel of 2 scans."""
    modes = MachineModes((BRAKED,), 0.01, 2)
    rows = np.column_stack([np.zeros(len(READ)), READ])
    states: list[int] = []
    void: dict[tuple[int, ...], list[int]] = {}
    for part in np.split(rows, cuts):
        found, voids = modes.step(part)
        for columns, flags in voids:
            void.setdefault(columns, []).extend((np.flatnonzero(flags) + len(states)).tolist())
        states += found[:, 0].tolist()
    return states, void


@pytest.mark.parametrize("cuts", [[], [4, 5, 11], list(range(1, len(READ)))])
def test_a_mode_lasts_for_a_kernel_and_for_what_it_settles_in(cuts: list[int]) -> None:
    states, void = taken(cuts)
    # Scan 4 is in the kernels of 4 and 5; two more scans settle.
    wanted = [OUT] * 3 + [IN] * 5 + [OUT] * 3 + [UNKNOWN, IN, IN]
    assert states == wanted
    assert void[(0, 3)] == [3, 4, 5, 6, 7, 11, 12, 13]
    # What holds in this mode alone never does: it lasts for less than a kernel.
    assert void[(2,)] == list(range(14))


def test_after_a_gap_nothing_lasts() -> None:
    modes = MachineModes((BRAKED,), 0.01, 2)
    modes.step(np.array([[0.0, 1.0]]))
    modes.interrupt()
    states, _ = modes.step(np.array([[0.0, 0.0]]))
    assert states.tolist() == [[OUT]]
