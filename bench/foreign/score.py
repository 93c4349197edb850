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

"""Single faults on foreign machines that nobody tuned on: found, wrong, said before, quiet.

    .venv/bin/python bench/foreign/score.py hoist --json FILE     or arm; some minutes

A machine is drawn by its seed, described from a data sheet of its own (`descriptions`), calibrated
from tables of three units with six motions each by `flea calibrate`, and diagnosed: so many runs
with one fault, healthy runs of a unit of the calibration, of other units, and with more payload
than any recording of the calibration; these and the runs with a fault carry what is drawn for each.
Nothing of the diagnosis is used by the plant. Each run is 40 s, its fault begins at 14 to 18 s.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

sys.path[:0] = [str(Path(__file__).resolve().parent), str(Path(__file__).resolve().parents[1])]

import numpy as np
from descriptions import write_stand
from machines import Foreign, drawn, readings
from plant import Numbers, scaled, simulated, with_weight
from summary import Figure, share, write_summary

SCORED = {"hoist": (61, 9601), "arm": (62, 9602)}
"""Seeds of machine and runs that are scored once; written down before any of it was diagnosed."""
SECONDS, UNITS, MOTIONS = 40.0, (1, 2, 3), 6
MOST_MEMBERS = 3


@dataclass(frozen=True)
class Outcome:
    """What became of a run; ``far`` is one of found, wrong, said, missed, early, quiet, alarm."""

    kind: str
    size: float
    far: str
    outcome: str
    group: tuple[str, ...]
    delay_s: float


def faulty(name: str, numbers: Numbers, size: float) -> Numbers:
    """The plant with a fault of this size."""
    if name == "jam":
        return scaled(numbers, dry=1.0 + size, sticks=1.0 + size)
    changes: dict[str, dict[str, float]] = {
        "gear_friction": {"viscous": 1.0 + 2.0 * size},
        "magnet_loss": {"constant": 1.0 - 0.2 * size},
        "winding_resistance_rise": {"resistance": 1.0 + 0.6 * size},
        "winding_short": {"resistance": 1 - 0.2 * size, "constant": 1 - 0.2 * size,
                          "inductance": (1 - 0.2 * size) ** 2},
        "supply_sag": {"share": 1.0 - 0.2 * size},
    }  # fmt: skip
    if name == "weak_drive":
        return numbers._replace(weak=0.2 * size)
    return scaled(numbers, **changes[name]) if name in changes else numbers


def misread(
    made: Foreign, channel: str, mode: str, size: float, values: Any, age_s: Any, true: Any
) -> Any:
    """Readings of a channel with an error of this size; ``age_s`` is negative before it."""
    full = {
        "motor_current": made.numbers.limit / 5.0, "motor_voltage": 0.15 * made.numbers.supply,
        "bus_voltage": 0.15 * made.numbers.supply, "motor_speed": 0.3 * made.fast / made.ratio,
        "motor_temperature": 8.0, "load_position": 0.05 * made.reach,
        "actuator_position": 0.05 * made.reach,
    }[channel]  # fmt: skip
    on = age_s >= 0.0
    changed = {
        "bias": values + size * full,
        "drift": values + 0.1 * size * full * np.maximum(age_s, 0.0),
        "scaling": values * (1.0 + 0.25 * size),
        "dead": np.zeros_like(values),
    }[mode]
    return np.where(on, changed, values)


def kinds(made: Foreign) -> list[str]:
    """Faults that are drawn, plant and sensors; a position that leaps or dies among them."""
    plant = ["jam", "gear_friction", "magnet_loss", "winding_resistance_rise"]
    channels = ["motor_current", "motor_speed", "actuator_position", "motor_temperature"]
    if made.arm:
        channels.append("load_position")
    else:
        plant += ["winding_short", "weak_drive", "supply_sag"]
        channels += ["motor_voltage", "bus_voltage"]
    modes = ("bias", "drift", "scaling", "dead")
    return [*plant, *(f"{channel}_{mode}" for channel in channels for mode in modes)]


def run_of(
    made: Foreign, unit: int, rng: np.random.Generator, kind: str, size: float, payload: float
) -> tuple[dict[str, Any], float]:
    """Readings of one run, and its onset in s."""
    numbers = made.unit(unit)
    if payload:
        numbers = with_weight(numbers, payload, made.arm)
    onset_s = float(rng.uniform(14.0, 18.0))
    broken = faulty(kind, numbers, abs(size)) if kind else numbers
    signals = simulated(numbers, made.course(rng, SECONDS), onset_s, broken)
    found = readings(made, signals, rng)
    channel, _, mode = kind.rpartition("_")
    if channel in made.channels and mode in ("bias", "drift", "scaling", "dead"):
        age = np.arange(len(found[channel])) * 0.01 - onset_s
        found[channel] = misread(made, channel, mode, size, found[channel], age, None)
    return found, onset_s


def calibrated(made: Foreign, folder: Path) -> None:
    """Write the stand and tables of healthy runs, and calibrate by the command."""
    from flea_diag.tools.main import main

    write_stand(made, folder)
    tables = []
    for unit in UNITS:
        for motion in range(MOTIONS):
            rng = np.random.default_rng((3, unit, motion))
            # The description leaves the payload free per run, so recordings hold several.
            found, _ = run_of(made, unit, rng, "", 0.0, float(rng.uniform(0.0, made.payload)))
            path = folder / "tables" / f"unit{unit}_run{motion}.csv"
            path.parent.mkdir(exist_ok=True)
            times = np.arange(len(found["motor_current"])) * 0.01
            rows = np.column_stack([times, *found.values()])
            head = ",".join(("time_s", *found))
            np.savetxt(path, rows, "%.9g", delimiter=",", header=head, comments="")
            tables.append(str(path))
    given = ["--stand", str(folder), "-o", str(folder / "calibration.yaml"), "--force"]
    if main(["calibrate", *tables, *given, "--jobs", "1"]) == 2:
        raise SystemExit("calibration refused")


def said_before(made: Foreign, folder: Path) -> frozenset[str]:
    """Faults of which ``not_observable`` says, of a healthy run, that no size of them shows."""
    import flea_diag as fd

    found, _ = run_of(made, UNITS[0], np.random.default_rng(8), "", 0.0, 0.0)
    stand = fd.Stand.load(folder)
    return frozenset(fd.diagnose(found, stand, rate_hz=100.0, residuals=False).not_observable)


def diagnosed(made: Foreign, folder: Path, found: dict[str, Any], kind: str, onset_s: float,
              size: float, said: frozenset[str]) -> Outcome:  # fmt: skip
    """Diagnose a run, and say what became of it."""
    import flea_diag as fd

    told = fd.diagnose(found, fd.Stand.load(folder), rate_hz=100.0, residuals=False)
    group = tuple(sorted(fault.fault for fault in told.group))
    told_at = told.episodes[-1].detected_at_s if told.episodes else float("nan")
    alarmed = told.outcome not in ("NOMINAL", "NOT_OBSERVABLE") or bool(told.episodes)
    truth = kind if kind in kinds(made) else ""
    if not truth:
        far = "alarm" if alarmed else "quiet"
    elif any(each.detected_at_s < onset_s for each in told.episodes):
        far = "early"
    elif truth in group and len(group) <= MOST_MEMBERS:
        far = "found"
    elif told.outcome == "ISOLATED":
        far = "wrong"
    elif not alarmed:
        far = "said" if truth in said else "missed"
    else:
        far = "large" if truth in group else "other"
    return Outcome(kind, size, far, told.outcome, group, told_at - onset_s)


def scored(
    made: Foreign, folder: Path, seed: int, cases: int, healthy: int, said: frozenset[str]
) -> Iterator[Outcome]:
    """All runs, in order."""
    every = kinds(made)
    for number in range(cases):
        rng = np.random.default_rng((5, seed, number))
        kind = every[number % len(every)]
        size = float(rng.uniform(0.5, 1.3) * rng.choice([-1.0, 1.0]))
        unit = UNITS[0] if number % 2 else 1000 + number
        carried = float(rng.uniform(0.0, made.payload))
        found, onset_s = run_of(made, unit, rng, kind, size, carried)
        yield diagnosed(made, folder, found, kind, onset_s, size, said)
    plan = (("healthy", 1, 0.0), ("other unit", 2, 0.0), ("payload", 1, made.payload))
    for kind, which, payload in plan:
        for number in range(healthy):
            rng = np.random.default_rng((6, seed, which, number, bool(payload)))
            unit = UNITS[0] if which == 1 else 2000 + number
            found, onset_s = run_of(made, unit, rng, "", 0.0, payload)
            yield diagnosed(made, folder, found, kind, onset_s, 0.0, said)


FARS = {
    "found": "found: detected after its onset, in a group of at most 3",
    "wrong": "wrong: another fault ISOLATED",
    "large": "in a larger group",
    "other": "UNEXPLAINED, or in a group without it",
    "early": "an alarm before the onset",
    "missed": "no alarm, and not said before",
    "said": "no alarm, and not_observable says so",
}
HELD = (
    ("runs of rows said before, found nevertheless", True, ("found",)),
    ("runs of rows said before, no alarm", True, ("said",)),
    ("runs of rows not said before, no alarm", False, ("missed",)),
)
"""Words, of rows that were said before or of others, and what became of the runs."""
QUIET = {
    "healthy": "healthy, a unit of the calibration: quiet",
    "other unit": "healthy, another unit: quiet",
    "payload": "healthy, another payload: quiet",
}


def figures(family: str, rows: list[Outcome], seed: str, said: frozenset[str]) -> Iterator[Figure]:
    """Shares of all faults and of each kind, of healthy runs, and what was said before."""
    faults = [row for row in rows if row.kind not in QUIET]
    for far, words in FARS.items():
        count = sum(row.far == far for row in faults)
        yield share(f"{family}: {words}", count, len(faults), seed=seed)
    every = dict.fromkeys(row.kind for row in faults)
    words = f"{family}: rows of the catalogue that not_observable says before"
    yield share(words, len(said & set(every)), len(every), seed=seed)
    for words, of_said, fars in HELD:
        ours = [row for row in faults if (row.kind in said) is of_said]
        if ours:
            count = sum(row.far in fars for row in ours)
            yield share(f"{family}: {words}", count, len(ours), seed=seed)
    for kind, words in QUIET.items():
        ours = [row for row in rows if row.kind == kind]
        yield share(f"{family}: {words}", sum(r.far == "quiet" for r in ours), len(ours), seed=seed)
    for kind in every:
        ours = [row for row in faults if row.kind == kind]
        found = sum(row.far == "found" for row in ours)
        yield share(f"{family}: {kind} found", found, len(ours), seed=seed)


def main() -> None:
    """Score one machine."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("family", choices=("hoist", "arm"))
    parser.add_argument("--machine-seed", type=int, help="default: the one that is scored")
    parser.add_argument("--seed", type=int, help="of the runs; default: the one that is scored")
    parser.add_argument("--cases", type=int, default=150)
    parser.add_argument("--healthy", type=int, default=50)
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    parser.add_argument("--rows", type=Path, help="write each run to this file")
    parser.add_argument("--folder", type=Path, help="where its stand is kept")
    given = parser.parse_args()
    folder = given.folder or Path(tempfile.mkdtemp(prefix="foreign_"))
    seeds = SCORED[given.family]
    machine, seed = (g if g is not None else s for g, s in
                     zip((given.machine_seed, given.seed), seeds, strict=True))  # fmt: skip
    made = drawn(given.family, machine)
    calibrated(made, folder)
    rows: list[Outcome] = []
    said = said_before(made, folder)
    print("said before:", ", ".join(sorted(said)) or "none", flush=True)
    for row in scored(made, folder, seed, given.cases, given.healthy, said):
        rows.append(row)
        print(f"{row.kind:28} {row.size:6.2f} {row.far:7} {row.outcome:18} "
              f"{row.delay_s:6.2f} {', '.join(row.group)}", flush=True)  # fmt: skip
        if given.rows:
            text = json.dumps([asdict(each) for each in rows], indent=1)
            given.rows.write_text(text, encoding="utf-8")
    found = figures(given.family, rows, f"machine {machine}, runs {seed}", said)
    write_summary("bench/foreign/score.py", found, given.json)


if __name__ == "__main__":
    main()
