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

"""Runs the simulated stand with one fault of ``simulated_faults.yaml`` and judges the verdict."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from flea_diag.configuration.component import make_pipeline
from flea_diag.configuration.files import load_yaml
from flea_diag.configuration.stand import load_stand
from flea_diag.tools.evaluate.case_run import diagnose
from flea_diag.wire.records import AmbiguityGroup, ChannelTable, Scan
from flea_sim_driver.scenario.scenario_file import scenario_from_mapping
from flea_sim_driver.stand import SimulatedStand

TABLE = Path(__file__).with_suffix(".yaml")


@dataclass(frozen=True)
class Judged:
    """What became of one run: right, early (before the onset), missed or wrong."""

    row: str
    seed: int
    outcome: str
    group: tuple[str, ...]
    early: bool
    right: bool
    delay_s: float


@cache
def table() -> dict[str, Any]:
    """The committed table."""
    content: dict[str, Any] = load_yaml(TABLE)
    return content


def scenario(row: str, seed: int) -> dict[str, Any]:
    """Scenario of one row: motion, load and plant go with the seed."""
    whole, entry = table(), table()["faults"][row]
    event = {key: entry[key] for key in ("fault", "where", "size") if key in entry}
    return {
        "motion": whole["motions"][seed % len(whole["motions"])],
        "load": whole["loads"][seed % len(whole["loads"])],
        "duration_s": whole["duration_s"],
        "seed": seed,
        "unit_spread": whole["unit_spread"],
        "sensors": {"vibration": False},
        "faults": [{**event, "onset_s": whole["onset_s"]}],
    }


def judged(row: str, seed: int) -> Judged:
    """Diagnose one run without its truth, and hold the last verdict against the table."""
    stand = SimulatedStand(scenario_from_mapping(scenario(row, seed), row))
    records = [record for record in stand if isinstance(record, (ChannelTable, Scan))]
    found = diagnose(records, make_pipeline(load_stand())).kept
    groups = [record for record in found if isinstance(record, AmbiguityGroup)]
    first_ns = next(record.stamp_ns for record in records if isinstance(record, Scan))
    entry, last = table()["faults"][row], groups[-1]
    names = tuple(member.fault for member in last.members)
    detected_s = (last.detected_stamp_ns - first_ns) / 1e9
    early = any(
        0 <= g.detected_stamp_ns < first_ns + table()["onset_s"] * 1e9 for g in groups if g.episode
    )
    right = entry["fault"] in names and set(names) <= set(entry["right"]) and not early
    return Judged(
        row, seed, last.outcome.name, names, early, right, detected_s - table()["onset_s"]
    )
