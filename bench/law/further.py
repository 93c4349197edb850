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

"""Score of the law of healthy recordings beyond the FLEA's orders, with seeds that are fixed here.

python bench/law/further.py [--part machines] [--part cranfield] [--part simulated] [--part loads]
    [--part before] [--part many] [--json FILE]

machines: fresh simulated units of ema, wing and joint, three of each, every healthy scenario once:
    standardised means of left-out recordings, and sound ones that are named unsound.
cranfield: the same of the normal tests of that stand.
simulated: laws of more and more simulated recordings of one FLEA, in 20 random orders.
loads: laws of the FLEA's recordings under small loads, and of all: sizes in what was covered first.
before: errors put into left-out recordings from their start: the size from which half of them are
    detected by the law of the others, beside the one that is said.
many: time and memory that the law of 29 and of 500 recordings takes.
"""

from __future__ import annotations

import math
import os
import resource
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from summary import Figure, bench_parser, share, write_summary

from flea_diag.core.run_law.visible_sizes import limit_nats, size_errors
from flea_diag.tools.main import main as flea
from law import score
from law.recordings import calibrated_on, design_of
from law.score import BEYOND, ERRORS, RATE, STEPS, Stand, half

UNITS = (90191, 90192, 90193)
"""Seeds of the units and of their noise; 90181 to 90183 were those of the law before."""
UNIT, ORDERS_SEED, ORDERS = 90201, 90194, 20
REPEATED = 5
"""Recordings of each scenario of the one simulated FLEA, each with a seed of its own from ``UNIT``
on: with one seed six motions began with the same error of their thermocouples."""
MACHINES = ("ema", "wing", "joint")
COUNTS = (4, 8, 16, 30)
SMALL_LOADS = "345"
"""Last digit of the motion in the FLEA's names: a mean load within 45 N."""


def simulated(folder: Path, machine: str, seeds: tuple[int, ...], unit: int = 0) -> list[Path]:
    """Bags of every healthy scenario of a machine with each seed, of one unit where it is given."""
    scenarios = Path(__file__).parents[2] / "config" / "scenarios"
    own = scenarios if machine == "flea" else scenarios / machine
    made = []
    # The stand itself reads its voltage in another way than its simulation does.
    names = {file.stem for file in own.glob("nominal*.yaml")} - {"nominal_flea"}
    for number, scenario in enumerate(sorted(names)):
        for seed in (each + number * len(seeds) if unit else each for each in seeds):
            bag = folder / f"{machine}_{scenario}_{seed}"
            of = ["--unit-seed", str(unit)] if unit else []
            told = [scenario, "--machine", machine, "--seed", str(seed), *of, "--no-vibration"]
            if flea(["simulate", *told, "-o", str(bag)]):
                raise SystemExit(f"{bag.name}: not simulated")
            made.append(bag)
    return made


def machines(folder: Path) -> Iterator[Figure]:
    """Fresh units of other makes."""
    for machine in MACHINES:
        yield from left_out(simulated(folder, machine, UNITS), machine)


def cranfield(folder: Path) -> Iterator[Figure]:
    """The normal tests of another stand."""
    file = Path(os.environ.get("FLEA_DATA_DIR", "../shared/data"), "cranfield", "normal.csv.gz")
    bags = folder / "cranfield"
    if flea(["import", "--stand", "cranfield", str(file), "-o", str(bags)]):
        raise SystemExit(f"{file}: not imported")
    yield from left_out(sorted(bags.iterdir()), "cranfield")


def left_out(bags: list[Path], stand: str) -> Iterator[Figure]:
    """Sound recordings that are named unsound, and the score of the law."""
    recordings, calibration = calibrated_on(bags, stand)
    design = design_of(calibration, recordings, stand)
    fit = design.learned(design.windows(recordings))
    for row in (*fit.unsound, *fit.contradicting, *fit.of_motion):
        print(f"  {recordings[row.place].run.name}: {row.kind} {row.what} {row.nats:.1f} nats")
    yield share(f"{stand}: a sound one is named unsound", len(fit.unsound), len(recordings))
    kept = (*fit.contradicting, *fit.of_motion)
    yield share(f"{stand}: contradicts, kept", len(kept), len(recordings))
    found = fit.law.score
    yield Figure(f"{stand}: standardised means of left-out recordings", found.spread, "1",
                 found.means)  # fmt: skip
    yield Figure(f"{stand}: of them beyond 2", 100.0 * found.beyond_two, "%", found.means)
    yield Figure(f"{stand}: left-out log score, the law", found.log_score, "nats a value",
                 found.means)  # fmt: skip
    yield Figure(f"{stand}: left-out log score, noise that holds everything", found.separate,
                 "nats a value", found.means)  # fmt: skip


def growing(folder: Path) -> Iterator[Figure]:
    """More and more recordings of one simulated FLEA."""
    seeds = tuple(range(UNIT, UNIT + REPEATED))
    recordings, calibration = calibrated_on(simulated(folder, "flea", seeds, UNIT))
    stand = Stand(recordings, calibration)
    yield from score.growing(stand, ORDERS_SEED, ORDERS, COUNTS, "simulated, ")


def loads(stand: Stand) -> Iterator[Figure]:
    """Sizes in recordings under small loads, by the law of these and by that of all."""
    small = [r for r in stand.runs if r.name.split("_")[1][-1] in SMALL_LOADS]
    limit = math.sqrt(2.0 * limit_nats(RATE, len(stand.design.faults)))
    found = []
    for runs in (small, stand.runs):
        fit = stand.design.learned(runs)
        errors = size_errors(fit.law, fit.columns, stand.design.faults, small)
        found.append(limit * np.median(errors.before[:, stand.places], axis=0))
    for place, few, every in zip(stand.places, *found, strict=True):
        name = stand.design.faults.columns[place].name
        yield Figure(f"{name} under small loads, law of all beside that of these", every / few, "1",
                     len(small), few, every)  # fmt: skip


def before(stand: Stand) -> Iterator[Figure]:
    """Said size against found size, of errors from before the recording."""
    limit = limit_nats(RATE, len(stand.design.faults))
    every = stand.design.learned(stand.runs)
    law = stand.design.with_sizes(every, stand.calibration, stand.recordings)
    laws = [stand.design.learned([r for r in stand.runs if r is not run]) for run in stand.runs]
    within = 0
    for fault, (channel, change) in ERRORS.items():
        place, said = next((k, row.before) for k, row in enumerate(law.visible)
                           if row.fault == fault and row.size != "level")  # fmt: skip
        ratio = half([
            np.mean([
                _seen(stand, fit, k, channel, change, step * said, place) > limit
                for k, fit in enumerate(laws)
            ])
            for step in STEPS
        ]) if math.isfinite(said) else BEYOND  # fmt: skip
        within += 1 / 1.5 <= ratio <= 1.5
        yield Figure(f"{fault} from before, law: found beside said {said:.3g}", ratio, "1",
                     len(STEPS) * len(laws))  # fmt: skip
    yield share("from before, law: found within 1.5 of said", within, len(ERRORS))


def _seen(
    stand: Stand, fit: Any, k: int, channel: str, change: Any, size: float, place: int
) -> float:
    spoilt = stand.changed(stand.recordings[k], channel, lambda y, t: change(y, t, size), 0)
    return float(stand.largest(fit, stand.windows(spoilt))[place])


def many(stand: Stand) -> Iterator[Figure]:
    """The FLEA's recordings again and again, under other names."""
    for count in (29, 500):
        runs = [
            replace(stand.runs[k % len(stand.runs)], name=f"run_{k}") for k in range(count)
        ]  # fmt: skip
        start = time.process_time()
        stand.design.learned(runs)
        took = time.process_time() - start
        yield Figure(f"law of {count} recordings: time of the processor", took, "s", 1)
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
        yield Figure(f"law of {count} recordings: most memory of the process", peak, "MB", 1)


def main() -> int:
    """Run and print."""
    parser = bench_parser(__doc__)
    names = ("machines", "cranfield", "simulated", "loads", "before", "many")
    parser.add_argument("--part", action="append", choices=names)
    arguments = parser.parse_args()
    figures: list[Figure] = []
    with TemporaryDirectory() as folder:
        parts = arguments.part or names
        stand = Stand.real(Path(folder, "bags")) if {*parts} & {*names[3:]} else None
        runs = {
            "machines": lambda: machines(Path(folder)),
            "cranfield": lambda: cranfield(Path(folder)),
            "simulated": lambda: growing(Path(folder)),
            "loads": lambda: loads(stand),
            "before": lambda: before(stand),
            "many": lambda: many(stand),
        }
        for part in parts:
            for figure in runs[part]():
                spread = "" if figure.low is None else f" ({figure.low:.4g} to {figure.high:.4g})"
                print(f"{figure.name}: {figure.value:.4g} {figure.unit}{spread}, n = {figure.n}",
                      flush=True)  # fmt: skip
                figures.append(figure)
    write_summary("law_further", figures, arguments.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
