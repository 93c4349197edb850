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

"""Faults found while readings are missing, beside the same runs with all of them.

python bench/robustness/missing_readings.py               2 runs of each fault and machine
python bench/robustness/missing_readings.py 1 --machine ema --seed 4200

Each run is diagnosed whole, with 3, 10 and 30 % of all readings missing at random, with one channel
at half its rate, and with a tenth of the scans lost. A fault is found if the last group holds it.
Times count from the onset to the detection.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from summary import Figure, bench_parser, share, write_summary

import flea_diag as fd
from flea_diag.configuration.component import make_pipeline
from flea_diag.configuration.stand import Stand, load_stand
from flea_diag.tools.evaluate.case_run import diagnose
from flea_diag.wire.records import AmbiguityGroup, ChannelTable, Outcome, Scan
from flea_sim_driver.machine.library import find_machine
from flea_sim_driver.machine.machine import Machine

SCORED_SEED = 4300
MACHINES = ("flea", "ema", "wing", "joint")
FAULTS = (
    "", "", "jam", "ball_nut_friction", "winding_short", "motor_failure", "motor_current_bias",
    "motor_current_scaling", "motor_speed_scaling", "load_force_bias", "actuator_position_bias",
    "motor_temperature_drift", "motor_current_dead",
)  # fmt: skip
ONSET_S, DURATION_S = 12.0, 40.0
Values = npt.NDArray[np.float64]
Random = np.random.Generator


def at_random(part: float, values: Values, draw: Random) -> Values:
    """So much of all readings is missing."""
    values[draw.random(values.shape) < part] = np.nan
    return values


def at_half_rate(values: Values, draw: Random) -> Values:
    """Every second reading of one channel is missing."""
    values[1::2, draw.integers(values.shape[1])] = np.nan
    return values


def with_losses(values: Values, draw: Random) -> Values:
    """A tenth of the scans is lost; rows of NaN throughout stand for them."""
    values[draw.random(len(values)) < 0.1] = np.nan
    return values


KINDS: dict[str, Callable[[Values, Random], Values]] = {
    "whole": lambda values, draw: values,
    "3 % missing": lambda values, draw: at_random(0.03, values, draw),
    "10 % missing": lambda values, draw: at_random(0.1, values, draw),
    "30 % missing": lambda values, draw: at_random(0.3, values, draw),
    "one channel at half its rate": at_half_rate,
    "a tenth of the scans lost": with_losses,
}


class Run(NamedTuple):
    """What came of one run: seconds from the onset to the detection (NaN: none), and the group."""

    delay_s: float
    group: frozenset[str]
    isolated: bool


def spoilt(scans: list[Scan], kind: str, draw: Random) -> list[Scan]:
    """The scans without what is missing."""
    values = KINDS[kind](np.array([scan.values for scan in scans]), draw)
    lost = np.isnan(values).all(axis=1) if kind == "a tenth of the scans lost" else None
    rows = zip(scans, values.tolist(), strict=True)
    return [
        replace(scan, values=tuple(row))
        for k, (scan, row) in enumerate(rows)
        if lost is None or not lost[k]
    ]


def diagnosed(stand: Stand, table: ChannelTable, scans: list[Scan]) -> Run:
    """Diagnose it."""
    done = diagnose(iter([table, *scans]), make_pipeline(stand))
    groups = [record for record in done.kept if isinstance(record, AmbiguityGroup)]
    opened = [group.detected_stamp_ns for group in groups if group.episode]
    first_s = (opened[0] - scans[0].stamp_ns) / 1e9 if opened else math.nan
    members = frozenset(member.fault for member in groups[-1].members)
    return Run(first_s - ONSET_S, members, groups[-1].outcome is Outcome.ISOLATED)


def has(machine: Machine, fault: str) -> bool:
    """Whether the machine can have it."""
    return fault in machine.faults or fault.rpartition("_")[0] in machine.sensor_faults


def runs_of(machine: str, fault: str, seed: int, number: int) -> dict[str, Run]:
    """One simulated run, by what is missing of it."""
    made = fd.simulate("nominal", machine=machine, seed=seed + number, duration_s=DURATION_S,
                       fault=fault, onset_s=ONSET_S)  # fmt: skip
    (table,) = made.records((ChannelTable,))
    scans = [record for record in made.records((Scan,)) if isinstance(record, Scan)]
    stand = load_stand(machine)
    found = {}
    for place, kind in enumerate(KINDS):
        draw = np.random.default_rng((seed, number, place))
        found[kind] = diagnosed(stand, table, spoilt(scans, kind, draw))
    return found


def figures_of(found: list[tuple[str, dict[str, Run]]]) -> list[Figure]:
    """Shares by what is missing, of the runs whose fault is found when nothing is."""
    figures = []
    healthy = [runs for fault, runs in found if not fault]
    faulty = [(fault, runs) for fault, runs in found if fault]
    seen = [(f, r) for f, r in faulty if r["whole"].delay_s > 0 and f in r["whole"].group]
    for kind in KINDS:
        quiet = sum(math.isnan(runs[kind].delay_s) for runs in healthy)
        figures.append(share(f"{kind}: healthy runs quiet", quiet, len(healthy)))
        wrong = sum(r[kind].isolated and f not in r[kind].group for f, r in faulty)
        figures.append(share(f"{kind}: another fault ISOLATED", wrong, len(faulty)))
        named = [(f, r) for f, r in seen if f in r[kind].group and r[kind].delay_s > 0]
        figures.append(share(f"{kind}: found of those found whole", len(named), len(seen)))
        soon = sum(r[kind].delay_s <= 1.5 * r["whole"].delay_s for _, r in named)
        figures.append(share(f"{kind}: in 1.5 times the time", soon, len(seen)))
        small = sum(len(r[kind].group) <= 1.3 * len(r["whole"].group) for _, r in named)
        figures.append(share(f"{kind}: a group of at most 1.3 times the size", small, len(seen)))
    return figures


def main() -> int:
    """Run and print."""
    parser = bench_parser(__doc__)
    parser.add_argument("runs", nargs="?", type=int, default=2, help="of each fault and machine")
    parser.add_argument("--seed", type=int, default=SCORED_SEED)
    parser.add_argument("--machine", choices=MACHINES, action="append")
    arguments = parser.parse_args()
    found = []
    for machine in arguments.machine or MACHINES:
        made = find_machine(machine)
        for row, fault in enumerate(FAULTS):
            if fault and not has(made, fault):
                continue
            for k in range(arguments.runs):
                number = 1000 * MACHINES.index(machine) + 20 * row + k
                runs = runs_of(machine, fault, arguments.seed, number)
                found.append((fault, runs))
                words = (f"{kind}: {r.delay_s:.2f} s, {', '.join(sorted(r.group)) or '-'}"
                         for kind, r in runs.items())  # fmt: skip
                print(f"{machine} {fault or 'healthy'} | {' | '.join(words)}", flush=True)
    figures = figures_of(found)
    for figure in figures:
        print(f"{figure.name}: {figure.value:.1f} % of {figure.n}")
    write_summary("bench/robustness/missing_readings.py", figures, arguments.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
