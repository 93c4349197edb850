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

"""Runs of simulated stands, recorded once: what a source sends, with its stamps from 0."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

from flea_diag.wire.records import ChannelTable, Record, Scan
from flea_sim_driver.scenario.scenario_file import scenario_from_mapping
from flea_sim_driver.stand import SimulatedStand

MOTIONS = (
    {"kind": "sine", "amplitude_m": 0.018, "frequency_hz": 0.5, "centre_m": 0.045},
    {"kind": "sine", "amplitude_m": 0.012, "frequency_hz": 0.8, "centre_m": 0.045},
)
FAULTS: tuple[dict[str, Any] | None, ...] = (
    None,
    None,
    {"fault": "jam"},
    {"fault": "motor_current_bias"},
)
"""Of which one is drawn."""
PERIOD_NS = 10_000_000


@dataclass(frozen=True)
class Run:
    """Scans of one stand, with the fault that it has from ``onset_ns`` on; "" is none."""

    table: ChannelTable
    scans: tuple[Scan, ...]
    fault: str = ""
    onset_ns: int = 0


@lru_cache(maxsize=64)
def run_of(unit: int, duration_s: float = 24.0) -> Run:
    """One unit, with what is wrong with it drawn by its number."""
    fault = FAULTS[unit % len(FAULTS)]
    onset_s = duration_s / 2
    values = {
        "motion": MOTIONS[unit // len(FAULTS) % len(MOTIONS)],
        "duration_s": duration_s,
        "seed": 7_000 + unit,
        "sensors": {"vibration": False},
        "faults": [{**fault, "onset_s": onset_s}] if fault else [],
    }
    records: tuple[Record, ...] = tuple(SimulatedStand(scenario_from_mapping(values, "drawn")))
    table = next(record for record in records if isinstance(record, ChannelTable))
    scans = [record for record in records if isinstance(record, Scan)]
    first_ns = scans[0].stamp_ns
    return Run(
        replace(table, stamp_ns=0),
        tuple(replace(scan, stamp_ns=scan.stamp_ns - first_ns) for scan in scans),
        fault["fault"] if fault else "",
        round(onset_s * 1e9),
    )
