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

"""The simulated stand with one fault at a time, against groups that were stated beforehand.

One run a row; ``scripts/bench simulated_faults`` makes as many as wanted.
"""

from __future__ import annotations

import pytest
from support.simulated_faults import judged, table

from flea_diag.configuration.files import load_yaml
from flea_sim_driver.faults import fault_named
from flea_sim_driver.machine.library import find_machine

LEFT_TO_THE_BENCH = frozenset(("load_force_noise",))
"""Rows that are not yet right in every run: the bench says how many are."""
ROWS = [row for row in table()["faults"] if row not in LEFT_TO_THE_BENCH]


@pytest.mark.parametrize("row", ROWS)
def test_the_group_is_one_of_those_stated(row: str) -> None:
    found = judged(row, 900 + ROWS.index(row))
    assert not found.early, found
    assert found.right, found
    assert 0.0 <= found.delay_s < 6.0


def test_every_row_names_a_fault_of_both_catalogues() -> None:
    known = load_yaml("faults.yaml")
    modes = set(known["sensor_modes"])
    for row, entry in table()["faults"].items():
        assert fault_named(entry["fault"], find_machine("flea"), row)
        assert entry["fault"] in entry["right"]
        for fault in entry["right"]:
            assert fault in known["faults"] or fault.rpartition("_")[2] in modes, fault
        # More than one answer is right for a reason only.
        assert len(entry["right"]) == 1 or entry["reason"]


def test_a_group_without_the_fault_or_with_a_stranger_is_not_right(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    entry = table()["faults"]["load_force_bias"]
    monkeypatch.setitem(entry, "right", ["load_force_drift"])
    assert not judged("load_force_bias", 900).right
