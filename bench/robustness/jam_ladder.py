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

"""Jams just outside the envelope of a calibration against the same just inside, on three machines.

python bench/robustness/jam_ladder.py                 6 pairs of each size and machine
python bench/robustness/jam_ladder.py 10 --machine ema --seed 9900

Both runs of a pair are of one unit, one motion and one jam. Inside, the load is 0.7 to 1 times the
largest of the calibration, outside 1 to 1.3 times. A jam is found where it, or the lost lubrication
that slow channels do not tell from it, is in the last group, of at most three, and nothing was
called before.
"""

from __future__ import annotations

import sys
import tempfile
from functools import partial
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from robustness.healthy import DURATION_S, MACHINES, Values, scenario, wider
from summary import Figure, bench_parser, share, write_summary

from flea_diag.configuration.component import make_pipeline
from flea_diag.configuration.stand import Stand, load_stand
from flea_diag.tools.evaluate.case_run import diagnose
from flea_diag.wire.records import AmbiguityGroup
from flea_sim_driver.machine.library import find_machine
from flea_sim_driver.machine.machine import Machine
from flea_sim_driver.stand import SimulatedStand

SCORED_SEED = 9900
SIZES = (0.5, 0.7, 1.0, 1.5)
"""Drags, in times that of the FLEA's jammed unit and its like."""
INSIDE, OUTSIDE = 0.7, 1.0
"""Least load, in times the largest of the calibration; the most is 0.3 more."""
ONSET_S, GROUP = 20.0, 3
FOUND = {"jam", "ball_nut_friction"}


def found(stand: Stand, machine: Machine, file: str, given: Values, seed: tuple[int, ...]) -> bool:
    """Whether the jam of this run is found."""
    made = scenario(np.random.default_rng(seed), "as calibrated", machine, file, given)
    done = diagnose(SimulatedStand(made), make_pipeline(stand))
    groups = [record for record in done.kept if isinstance(record, AmbiguityGroup)]
    opened = [group.detected_stamp_ns for group in groups if group.episode]
    named = {member.fault for member in groups[-1].members}
    early = any(stamp < done.start_ns + ONSET_S * 1e9 for stamp in opened)
    return bool(opened) and not early and len(named) <= GROUP and bool(named & FOUND)


def pair(
    stand: Stand, machine: Machine, file: str, size: float, seed: tuple[int, ...]
) -> tuple[bool, bool]:
    """Found inside, and found outside."""
    draw = np.random.default_rng((*seed, 1))
    more, sign = float(draw.uniform(0.0, 0.3)), float(draw.choice((-1.0, 1.0)))
    fault = {"fault": "jam", "onset_s": ONSET_S, "size": size}
    return tuple(
        found(stand, machine, file, {
            "load": {"constant_n": round(sign * (least + more) * machine.limits.load_n, 1)},
            "faults": [fault],
            "duration_s": DURATION_S - ONSET_S,
        }, seed)
        for least in (INSIDE, OUTSIDE)
    )  # type: ignore[return-value]  # fmt: skip


def main() -> int:
    """Run and print."""
    parser = bench_parser(__doc__)
    parser.add_argument("pairs", nargs="?", type=int, default=6, help="of each size and machine")
    parser.add_argument("--seed", type=int, default=SCORED_SEED)
    parser.add_argument("--machine", choices=MACHINES, action="append")
    arguments = parser.parse_args()
    figures: list[Figure] = []
    counted = np.zeros((len(SIZES), 2), dtype=int)
    names = arguments.machine or MACHINES
    with tempfile.TemporaryDirectory() as folder:
        for name in names:
            machine, file = find_machine(name), wider(name, Path(folder))
            run = partial(pair, load_stand(name), machine, file)
            for row, size in enumerate(SIZES):
                seeds = [
                    (arguments.seed, MACHINES.index(name), row, k) for k in range(arguments.pairs)
                ]
                right = np.array([run(size, seed) for seed in seeds]).sum(axis=0)
                counted[row] += right
                print(f"{name}, size {size:g}: {right[0]} inside, {right[1]} outside", flush=True)
    n = arguments.pairs * len(names)
    for size, row in zip(SIZES, counted.tolist(), strict=True):
        for side, right in zip(("inside", "outside"), row, strict=True):
            figures.append(share(f"jam of {size:g}, {side}: found", right, n))
    for side, right in zip(("inside", "outside"), counted.sum(axis=0).tolist(), strict=True):
        figures.append(share(f"all sizes, {side}: found", right, n * len(SIZES)))
    for figure in figures:
        print(f"{figure.name}: {figure.value:.1f} % of {figure.n}")
    write_summary("bench/robustness/jam_ladder.py", figures, arguments.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
