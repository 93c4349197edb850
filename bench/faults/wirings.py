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

"""Channels that are wired wrong, and machines that are not: what is said of the wiring.

python bench/faults/wirings.py                  4 runs of each wiring and fault and machine
python bench/faults/wirings.py 1 --machine ema --seed 9000

A wiring is named if the last verdict is DATA_UNUSABLE with its words, alone or with others, and a
pair if it stands beside faults. Correctly wired runs must say nothing of it, healthy or with a
fault from the first scan on, or from later on.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path

sys.path[:0] = [str(Path(__file__).resolve().parents[1]),
                str(Path(__file__).resolve().parents[2] / "test")]  # fmt: skip

from summary import Figure, bench_parser, share, write_summary
from support.graph.wrong_wiring import Wiring, cut_off, late, scaled, swapped

import flea_diag as fd
from flea_diag.configuration.component import make_pipeline
from flea_diag.configuration.stand import load_stand
from flea_diag.stages.wiring.stream_wiring import WIRED_WRONG
from flea_diag.tools.evaluate.case_run import diagnose
from flea_diag.wire.records import AmbiguityGroup, ChannelTable, Outcome, Scan
from flea_sim_driver.machine.library import find_machine

SCORED_SEED = 24_400
MACHINES = ("flea", "ema")
FAULTS = (
    "jam", "ball_nut_friction", "winding_short", "motor_current_bias", "motor_current_scaling",
    "motor_speed_scaling", "load_force_bias", "load_force_scaling", "actuator_position_bias",
    "motor_voltage_scaling",
)  # fmt: skip
DURATION_S, LATER_S = 16.0, 6.0
NAMING = (Outcome.ISOLATED, Outcome.INDISTINGUISHABLE)


def wirings(period_s: float) -> dict[str, Wiring]:
    """Its words, and what it does to the scans."""

    def by(lag_s: float) -> int:
        return round(lag_s / period_s)

    return {
        "load_force: its sign is turned": partial(scaled, "load_force", -1.0),
        "load_force: it comes 200 ms late": partial(late, "load_force", by(0.2)),
        "load_force: it reads 1000 times": partial(scaled, "load_force", 1000.0),
        "commanded_voltage: its sign is turned": partial(scaled, "commanded_voltage", -1.0),
        "commanded_voltage: it is cut off": partial(cut_off, "commanded_voltage", 0.6),
        "actuator_position: it comes 50 ms late": partial(late, "actuator_position", by(0.05)),
        "motor_current: its sign is turned": partial(scaled, "motor_current", -1.0),
        "motor_speed: it reads 9.55": partial(scaled, "motor_speed", 30.0 / math.pi),
        "actuator_position: it reads 25.4": partial(scaled, "actuator_position", 25.4),
        "motor_voltage and commanded_voltage are swapped": partial(
            swapped, "motor_voltage", "commanded_voltage"
        ),
    }


def said_of(machine: str, records: list[ChannelTable | Scan]) -> list[AmbiguityGroup]:
    """Verdicts."""
    done = diagnose(iter(records), make_pipeline(load_stand(machine)))
    return [record for record in done.kept if isinstance(record, AmbiguityGroup)]


def recorded(
    machine: str, seed: int, fault: str = "", onset_s: float = 0.0
) -> list[ChannelTable | Scan]:
    """One simulated run."""
    made = fd.simulate("nominal", machine=machine, seed=seed, duration_s=DURATION_S,
                       fault=fault, onset_s=onset_s)  # fmt: skip
    return [r for r in made.records((ChannelTable, Scan)) if isinstance(r, (ChannelTable, Scan))]


def result_of_wiring(machine: str, words: str, change: Wiring, seed: int) -> str:
    """named, pair, component, other wiring or silent."""
    run = recorded(machine, seed)
    table = [r for r in run if isinstance(r, ChannelTable)]
    said = said_of(machine, [*table, *change([r for r in run if isinstance(r, Scan)])])
    last = said[-1]
    if any(v.outcome in NAMING and WIRED_WRONG not in v.words for v in said):
        return "component"
    if WIRED_WRONG not in last.words:
        return f"silent ({last.outcome.value})"
    if words not in last.words:
        return f"other wiring ({last.words})"
    return "named" if last.outcome is Outcome.DATA_UNUSABLE else "pair"


def result_of_right(machine: str, seed: int, fault: str, onset_s: float) -> str:
    """quiet, pair or wired wrong."""
    said = said_of(machine, recorded(machine, seed, fault, onset_s))
    worded = [v for v in said if WIRED_WRONG in v.words]
    if any(v.outcome is Outcome.DATA_UNUSABLE for v in worded):
        return "wired wrong"
    return "pair" if worded else "quiet"


def cases(machine: str) -> Iterator[tuple[str, str, float]]:
    """Kind, fault and onset of runs that are wired right."""
    made = find_machine(machine)
    yield from [("healthy", "", 0.0)] * 2
    for fault in FAULTS:
        if fault in made.faults or fault.rpartition("_")[0] in made.sensor_faults:
            yield "a fault from the first scan on", fault, 0.0
            yield "a fault from later on", fault, LATER_S


def main() -> int:
    """Run and print."""
    parser = bench_parser(__doc__)
    parser.add_argument("runs", nargs="?", type=int, default=4, help="of each")
    parser.add_argument("--seed", type=int, default=SCORED_SEED)
    parser.add_argument("--machine", choices=MACHINES, action="append")
    arguments = parser.parse_args()
    found: list[tuple[str, str]] = []
    for machine in arguments.machine or MACHINES:
        period_s = 1.0 / find_machine(machine).sampling.scan_rate_hz
        number = 1000 * MACHINES.index(machine)
        for words, change in wirings(period_s).items():
            for _ in range(arguments.runs):
                number += 1
                result = result_of_wiring(machine, words, change, arguments.seed + number)
                found.append(("wired wrong", result.partition(" (")[0]))
                print(f"{machine} {arguments.seed + number} {words}: {result}", flush=True)
        for kind, fault, onset_s in cases(machine):
            for _ in range(arguments.runs):
                number += 1
                result = result_of_right(machine, arguments.seed + number, fault, onset_s)
                found.append((kind, result))
                print(f"{machine} {arguments.seed + number} {kind} {fault}: {result}", flush=True)
    figures: list[Figure] = []
    for kind in dict.fromkeys(kind for kind, _ in found):
        results = [result for each, result in found if each == kind]
        for result in dict.fromkeys(results):
            figures.append(share(f"{kind}: {result}", results.count(result), len(results)))
    for figure in figures:
        print(f"{figure.name}: {figure.value:.1f} % of {figure.n}")
    write_summary("bench/faults/wirings.py", figures, arguments.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
