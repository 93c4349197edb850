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

"""Runs of the simulated stand for learning and scoring a fault feature table.

The seed determines motion, load, unit and severity of a run. Seeds used for learning must not be
used for scoring.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import partial
from typing import Any

import numpy as np

from flea_diag.core.choice.feature_learning import NOMINAL
from flea_diag.tools.features.samples import FeatureRun, Grid, run_of
from flea_diag.tools.workers import worker_pool
from flea_diag.wire.records import Truth
from flea_sim_driver.scenario.scenario_file import scenario_from_mapping
from flea_sim_driver.stand import SimulatedStand

SEVERITIES: dict[str, tuple[float, float]] = {
    "jam": (0.4, 2.5),
    "ball_nut_friction": (1.0, 8.0),
    "spall": (0.3, 3.0),
    "rotor_eccentricity": (0.4, 3.0),
    "backlash": (1e-4, 1e-3),
    "accelerometer_1_fault": (2.0, 30.0),
    "accelerometer_2_fault": (2.0, 30.0),
    "winding_short": (0.1, 0.4),
}
"""Smallest and largest size of each fault, in the units of the stand's fault catalogue."""

DEAD_SHARE = 0.25
"""Share of dead sensors among the accelerometer faults; the others are noisy."""

REST_SHARE = 0.1
"""Share of nominal runs without motion."""

FASTEST_M_S = 0.13
SMALLEST_LOAD_N, LARGEST_LOAD_N = 40.0, 300.0


def drawn_scenario(
    seed: int,
    fault: str,
    duration_s: float,
    onset_s: float = 0.0,
    loads_n: tuple[float, float] = (0.0, LARGEST_LOAD_N),
) -> dict[str, Any]:
    """Scenario of one run as a mapping; the fault is present from the start or from an onset.

    ``loads_n``: smallest and largest magnitude of the load, which may act in either direction.
    """
    draw = np.random.default_rng([seed, *fault.encode()])
    resting = fault == NOMINAL and draw.random() < REST_SHARE
    # Under a constant preload the gap is never crossed: backlash is learned at small loads.
    least, limit = (0.0, SMALLEST_LOAD_N) if fault == "backlash" else loads_n
    scenario: dict[str, Any] = {
        "name": f"{fault}_{seed}",
        "seed": seed,
        "duration_s": duration_s,
        "motion": {"kind": "hold"} if resting else _motion(draw),
        "load": {"constant_n": _load(draw, least, limit)},
    }
    if fault != NOMINAL:
        low, high = SEVERITIES[fault]
        size = math.exp(draw.uniform(math.log(low), math.log(high)))
        if fault.startswith("accelerometer") and draw.random() < DEAD_SHARE:
            size = 0.0
        scenario["faults"] = [{"fault": fault, "onset_s": onset_s, "size": size}]
    return scenario


def _load(draw: np.random.Generator, least: float, limit: float) -> float:
    drawn = float(draw.uniform(-limit, limit))
    return math.copysign(least + abs(drawn) * (1.0 - least / limit), drawn)


def _motion(draw: np.random.Generator) -> dict[str, Any]:
    kind = str(draw.choice(["sine", "sine", "triangle", "trapezoid", "sweep"]))
    frequency = math.exp(draw.uniform(math.log(0.25), math.log(1.2)))
    amplitude = draw.uniform(0.008, 0.035)
    motion: dict[str, Any] = {"kind": kind, "frequency_hz": frequency}
    if kind == "trapezoid":
        motion |= {"frequency_hz": 0.25, "rise_s": draw.uniform(0.7, 1.8)}
        fastest = FASTEST_M_S * motion["rise_s"] / 3.75
    elif kind == "sweep":
        motion |= {"frequency_hz": 0.25, "end_frequency_hz": 1.2}
        fastest = FASTEST_M_S / (2.0 * math.pi * 1.2)
    else:
        fastest = FASTEST_M_S / (2.0 * math.pi * frequency)
    return motion | {"amplitude_m": float(min(amplitude, fastest))}


def stand_run(
    job: tuple[int, str, float], grid: Grid, loads_n: tuple[float, float] = (0.0, LARGEST_LOAD_N)
) -> FeatureRun:
    """Simulate one run and cut it into samples."""
    seed, fault, duration_s = job
    mapping = drawn_scenario(seed, fault, duration_s, loads_n=loads_n)
    scenario = scenario_from_mapping(mapping, f"seed {seed}")
    records = list(SimulatedStand(scenario))
    truths = [record for record in records if isinstance(record, Truth)]
    return run_of(f"{fault} {seed}", records, truths, grid)


def stand_runs(
    seeds: Iterable[int],
    faults: Sequence[str],
    duration_s: float,
    grid: Grid,
    jobs: int = 1,
    loads_n: tuple[float, float] = (0.0, LARGEST_LOAD_N),
) -> list[FeatureRun]:
    """Runs of each fault with each seed, in order; ``jobs`` processes share the work."""
    todo = [(seed, fault, duration_s) for fault in faults for seed in seeds]
    work = partial(stand_run, grid=grid, loads_n=loads_n)
    if jobs == 1:
        return [work(job) for job in todo]
    with worker_pool(jobs) as pool:
        return list(pool.map(work, todo, chunksize=4))
