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

"""The 320 scenarios of Narasimhan et al. 2010, Table 4, drawn from a seed.

The paper gives rows and counts, four kinds of motion and constant loads within +-70 lb;
amplitudes, sizes and onsets are drawn here. Jam and spall are injected as on the FLEA: control
is switched from the healthy unit to the faulty one.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from flea_sim_driver.machine.library import DEFAULT_MACHINE, find_machine
from flea_sim_driver.machine.machine import DrawnMotion
from flea_sim_driver.scenario.scenario import Scenario
from flea_sim_driver.scenario.scenario_file import scenario_from_mapping

DURATION_S = 40.0
EARLIEST_ONSET_S, LATEST_ONSET_S = 12.0, 18.0
MOTIONS = ("sine", "trapezoid", "triangle", "sweep")


@dataclass(frozen=True)
class CampaignRow:
    """One row of the table: ``low`` to ``high`` is the range of the fault's size.

    A ladder has ``sizes`` instead, which its scenarios use in turn, each with every motion.
    """

    title: str
    fault: str
    scenarios: int
    low: float = 0.0
    high: float = 0.0
    either_sign: bool = False
    switched: bool = False
    sizes: tuple[float, ...] = ()
    warmer_k: float = 0.0


@dataclass(frozen=True)
class Shared:
    """Settings common to all scenarios of a set; ``values`` are further keys of a scenario."""

    duration_s: float = DURATION_S
    earliest_onset_s: float = EARLIEST_ONSET_S
    latest_onset_s: float = LATEST_ONSET_S
    values: Mapping[str, Any] = field(default_factory=dict)
    machine: str = DEFAULT_MACHINE


ROWS: tuple[CampaignRow, ...] = (
    CampaignRow("Nominal", "", 134),
    CampaignRow("Current Bias", "motor_current_bias", 15, 0.4, 1.5, either_sign=True),
    CampaignRow("Current Dead", "motor_current_dead", 15),
    CampaignRow("Current Drift", "motor_current_drift", 15, 0.05, 0.25, either_sign=True),
    CampaignRow("Position Sensor Failure", "actuator_position_dead", 21),
    CampaignRow("Current Scaling", "motor_current_scaling", 15, 1.3, 1.8),
    CampaignRow("Jam", "jam", 15, 0.7, 1.6, switched=True),
    CampaignRow("Motor Failure", "motor_failure", 15, 1.0, 1.0),
    CampaignRow("Spall", "spall", 15, 0.7, 2.0, switched=True),
    CampaignRow("Temp Bias", "motor_temperature_bias", 15, 5.0, 15.0, either_sign=True),
    CampaignRow("Temp Dead", "motor_temperature_dead", 15),
    CampaignRow("Temp Drift", "motor_temperature_drift", 15, 0.4, 1.2, either_sign=True),
    CampaignRow("Temp Scaling", "motor_temperature_scaling", 15, 1.25, 1.7),
)


def table4(seed: int) -> tuple[Scenario, ...]:
    """All scenarios, row by row; plant parameters are drawn for each."""
    return tuple(scenario for _, scenario in draw(ROWS, seed))


def draw(
    rows: Sequence[CampaignRow], seed: int, shared: Shared | None = None
) -> Iterator[tuple[CampaignRow, Scenario]]:
    """Scenarios of any such table, each with its row, one by one.

    Raises
    ------
    ConfigurationError
        The stand cannot run a row; the message gives name, value and limit.
    """
    common = shared or Shared()
    seeds = np.random.SeedSequence(seed)
    for row in rows:
        for number in range(row.scenarios):
            (stream,) = seeds.spawn(1)
            yield row, _scenario(row, number, np.random.default_rng(stream), common)


def _scenario(row: CampaignRow, number: int, draw: np.random.Generator, shared: Shared) -> Scenario:
    name = f"{row.fault or 'nominal'}_{number + 1:03d}"
    machine = find_machine(shared.machine)
    limit_n = machine.limits.load_n
    values: dict[str, Any] = {
        "name": name,
        "machine": shared.machine,
        "duration_s": shared.duration_s,
        "seed": int(draw.integers(2**31)),
        "ambient_degc": round(float(draw.uniform(20.0, 27.0)), 1),
        "warm_degc": round(float(draw.uniform(0.0, 10.0)), 1),
        "motion": _motion(MOTIONS[number % len(MOTIONS)], machine.drawn, draw),
        "load": {"constant_n": _load_n(float(draw.uniform(-limit_n, limit_n)), limit_n)},
        **shared.values,
    }
    if row.fault or row.switched:
        values |= _fault(row, number, draw, shared)
    return scenario_from_mapping(values, f"{row.title}, {name}")


def _load_n(drawn: float, limit_n: float) -> float:
    """Round to tenths, within the load limit of the machine."""
    return max(-limit_n, min(round(drawn, 1), limit_n))


def _motion(kind: str, of: DrawnMotion, draw: np.random.Generator) -> dict[str, Any]:
    amplitude = float(draw.uniform(*of.amplitude_m))
    motion: dict[str, Any] = {"kind": kind, "centre_m": round(float(draw.uniform(*of.centre_m)), 4)}
    if kind == "trapezoid":
        motion |= {
            "frequency_hz": round(float(draw.uniform(*of.trapezoid_hz)), 3), "rise_s": of.rise_s
        }  # fmt: skip
    else:
        fastest = of.speed_m_s / (2.0 * math.pi * amplitude)
        motion["frequency_hz"] = round(min(float(draw.uniform(*of.frequency_hz)), fastest), 3)
    if kind == "sweep":
        motion["end_frequency_hz"] = motion["frequency_hz"]
        motion["frequency_hz"] = of.sweep_from_hz
    return motion | {"amplitude_m": round(amplitude, 4)}


def _digits(largest: float) -> int:
    """Decimal places of a drawn size: three, or three significant digits of a small size."""
    return max(3, 2 - math.floor(math.log10(largest))) if largest > 0.0 else 3


def _fault(
    row: CampaignRow, number: int, draw: np.random.Generator, shared: Shared
) -> dict[str, Any]:
    onset = round(float(draw.uniform(shared.earliest_onset_s, shared.latest_onset_s)), 2)
    size = round(float(draw.uniform(row.low, row.high)), _digits(row.high))
    if row.sizes:
        size = row.sizes[number // len(MOTIONS) % len(row.sizes)]
    if row.either_sign and draw.random() < 0.5:
        size = -size
    switch = {"at_s": onset, "to": "X", "warmer_k": row.warmer_k}
    if not row.fault:
        return {"switch": switch}
    fault: dict[str, Any] = {"fault": row.fault}
    if row.high != 0.0 or row.sizes:
        fault["size"] = size
    if row.switched:
        return {"switch": switch, "faults": [fault | {"unit": "X"}]}
    return {"faults": [fault | {"onset_s": onset}]}
