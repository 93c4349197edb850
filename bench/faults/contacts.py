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

"""Contacts that come and go: whether they are told as such, and how often they are said to come.

python bench/faults/contacts.py --first 9700 --runs 30 --json FILE
python bench/faults/contacts.py --first 9740 --runs 10 --machine ema --lasts 0.02

Each run is of a unit of its own on one of three machines, or on the one that is named, 60 s in a
motion that is drawn as those of the calibrations are: an opening of the winding or of the supply
that lasts for 0.1 to 0.6 s, or as long as is said, and is gone for 0.8 to 3 s, some regular and
some at random. The truth is how often it came between the first and the last time that were told;
what the diagnosis says is how often it was seen, and how often it may have come with the time in
which the motion could not show it.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from robustness.healthy import drawn_motion, scenario
from summary import Figure, bench_parser, share, write_summary

from flea_diag.configuration.component import make_pipeline
from flea_diag.configuration.stand import load_stand
from flea_diag.tools.evaluate.case_run import diagnose
from flea_diag.wire.records import AmbiguityGroup, Scan, Truth
from flea_sim_driver.machine.library import find_machine
from flea_sim_driver.schedule import courses
from flea_sim_driver.stand import SimulatedStand

SCORED_SEED = 9700
MACHINES, FAULTS = ("flea", "ema", "wing"), ("winding_open", "supply_open")
LASTS_S, ONSET_S, STEP_S = 60.0, 8.0, 0.005
SLACK_S = 0.5
"""By how much the time of a coming may be off."""


@dataclass(frozen=True)
class Contact:
    """One run: what was told of it, and how often it came within the times that were told."""

    said: str
    named: bool
    count: int = 0
    most: int = 0
    truth: int = 0


def run(seed: int, machine_name: str | None = None, lasts_s: float | None = None) -> Contact:
    """One contact through simulator and diagnosis."""
    draw = np.random.default_rng((seed, 9))
    name, fault = machine_name or MACHINES[seed % 3], FAULTS[seed // 3 % 2]
    machine, on_s = find_machine(name), round(float(draw.uniform(0.1, 0.6)), 2)
    setting = {
        "fault": fault, "onset_s": ONSET_S, "on_s": lasts_s or on_s,
        "off_s": round(float(draw.uniform(0.8, 3.0)), 2),
        "irregular": float(draw.integers(2)),
    }  # fmt: skip
    given = {"duration_s": LASTS_S, "motion": drawn_motion(draw, machine), "faults": [setting]}
    made = scenario(draw, "as calibrated", machine, name, given)
    records = [r for r in SimulatedStand(made) if not isinstance(r, Truth)]
    start_ns = next(r.stamp_ns for r in records if isinstance(r, Scan))
    done = diagnose(records, make_pipeline(load_stand(name)))
    groups = [record for record in done.kept if isinstance(record, AmbiguityGroup)]
    what = f"{seed} {name} {fault} {setting['on_s']} s in {setting['off_s']} s"
    told = [group for group in groups if group.comes_and_goes]
    if not told:
        return Contact(f"{what}: {groups[-1].words}", named=False)
    (comes,) = told[-1].comes_and_goes
    named = fault in {member.fault for member in told[-1].members}
    (course,) = courses(made)
    times = np.arange(0.0, LASTS_S, STEP_S)
    there = np.array([course.size_at(t, made.run.active_unit) is not None for t in times.tolist()])
    came = times[1:][np.diff(there.astype(int)) > 0]
    first, last = ((ns - start_ns) / 1e9 for ns in (comes.first_ns, comes.last_ns))
    truth = int(((came > first - SLACK_S) & (came < last + SLACK_S)).sum())
    said = f"{what}: {comes.count} to {comes.most} of {truth}, unseen {comes.unseen_s:.1f} s"
    return Contact(said, named, comes.count, comes.most, truth)


def main() -> int:
    """Run and print."""
    parser = bench_parser(__doc__)
    parser.add_argument("--first", type=int, default=SCORED_SEED, help="first seed")
    parser.add_argument("--runs", type=int, default=30)
    parser.add_argument("--machine", choices=MACHINES, help="of all runs; without it by the seed")
    parser.add_argument("--lasts", type=float, metavar="S", help="how long each opening lasts")
    arguments = parser.parse_args()
    found = []
    for seed in range(arguments.first, arguments.first + arguments.runs):
        found.append(run(seed, arguments.machine, arguments.lasts))
        print(found[-1].said, "" if found[-1].named else "MISSED", flush=True)
    told = [each for each in found if each.named]
    within = sum(abs(each.count - each.truth) <= 1 for each in told)
    held = sum(each.count <= each.truth <= each.most for each in told)
    near = sum(each.count - 1 <= each.truth <= each.most + 1 for each in told)
    figures: list[Figure] = [
        share("told as coming and going, by its name", len(told), len(found)),
        share("count that was seen within 1", within, len(told)),
        share("count within what is said", held, len(told)),
        share("count within 1 of what is said", near, len(told)),
    ]
    for figure in figures:
        print(f"{figure.name}: {figure.value:.1f} {figure.unit} of {figure.n}")
    write_summary("bench/faults/contacts.py", figures, arguments.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
