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

"""One fault that is followed for minutes, and healthy runs of minutes.

python bench/faults/long_runs.py               20 faults and 6 healthy runs of each machine
python bench/faults/long_runs.py 5 --machine ema --seed 39400

Faults, sizes and motions are drawn as those of the pairs are, and alone in their run of 150 s. The
verdict is kept where the last one holds the fault in a set of at most four names, and none of all
tells two faults. A healthy run of 300 s is quiet where nothing is detected.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from faults.pairs_of_faults import (
    MACHINES,
    MOST,
    MOTIONS,
    drawn,
    known,
    records,
    scenario,
    verdicts,
)
from summary import bench_parser, share, write_summary

from flea_diag.wire.records import AmbiguityGroup, Outcome

SCORED_SEED = 39400
FAULT_S, HEALTHY_S = 150.0, 300.0
NAMING = (Outcome.ISOLATED, Outcome.INDISTINGUISHABLE)


def keeps(fault: str, said: list[AmbiguityGroup]) -> bool:
    """Whether the verdict on one fault stays what it is."""
    last = said[-1]
    names = [member.fault for member in last.members]
    is_told = last.outcome in NAMING and fault in names and len(names) <= MOST
    return is_told and not any(each.pairs for each in said)


def main() -> int:
    """Run and print."""
    parser = bench_parser(__doc__)
    parser.add_argument("runs", nargs="?", type=int, default=20, help="of each machine")
    parser.add_argument("--healthy", type=int, default=6, help="healthy runs of each machine")
    parser.add_argument("--seed", type=int, default=SCORED_SEED)
    parser.add_argument("--machine", choices=MACHINES, action="append")
    arguments, kept, quiet = parser.parse_args(), list[bool](), list[bool]()
    for machine in arguments.machine or MACHINES:
        for number in range(arguments.runs):
            pair = drawn(machine, arguments.seed + number, 0.0)
            fault = pair.faults[0]
            made = scenario(machine, pair.seed, pair.motion, FAULT_S, fault)
            said = verdicts(known(machine)[0], records(made))
            kept.append(keeps(fault.fault, said))
            names = ", ".join(member.fault for member in said[-1].members) or "-"
            told = f"{said[-1].outcome.name}: {names}"
            print(
                f"{machine} {pair.seed} {fault.fault} | {told}{'' if kept[-1] else ' LOST'}",
                flush=True,
            )
        for number in range(arguments.healthy):
            seed, motion = arguments.seed + number, MOTIONS[number % len(MOTIONS)]
            made = scenario(machine, seed, motion, HEALTHY_S)
            said = verdicts(known(machine)[0], records(made))
            quiet.append(not any(each.episode for each in said))
            print(
                f"{machine} {seed} healthy {motion} | {'quiet' if quiet[-1] else 'ALARM'}",
                flush=True,
            )
    figures = [
        share("one fault, followed for 150 s: the verdict is kept", sum(kept), len(kept)),
        share("healthy runs of 300 s: quiet", sum(quiet), len(quiet)),
    ]
    for figure in figures:
        print(f"{figure.name}: {figure.value:.1f} % of {figure.n}")
    write_summary("bench/faults/long_runs.py", figures, arguments.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
