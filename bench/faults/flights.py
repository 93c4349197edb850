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

"""Control surfaces in flight: which faults of twice their bound are found in 10 s of motion.

python bench/faults/flights.py --prepare FOLDER
python bench/faults/flights.py --stand FOLDER --seed 6200 --count 40 --json flights.json

The first makes the stand of the second: the shipped description with its bridge named and a
friction whose sign is as wide as an encoder needs, calibrated on strokes and on flights of
``NOMINAL_SEEDS``: units of their own, each with every fourth profile, since what units differ by
needs more units than flights.

Each seed flies one of the 20 profiles, healthy and with two of ``FAULTS``, in turn, from
``ONSET_S`` on; every second healthy one also with a coupling. The
bound of a fault is what the law of the calibration holds on it in that very motion: of the healthy
run, in the windows of the 10 s of motion after the onset, the size that exceeds the limit of the
evidence in half of all runs (``core/run_law/visible_sizes.py``). Found: the first detection after
the onset lies within these 10 s of motion, and the healthy flight of the seed is quiet. Motion is a
speed above ``MOVES_M_S``.
"""

from __future__ import annotations

import math
import shutil
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from summary import ROOT, Figure, bench_parser, share, write_summary

from flea_diag.configuration.calibrations import learned
from flea_diag.configuration.description import described
from flea_diag.configuration.stand import Stand, load_stand
from flea_diag.core.calibration.calibration import Calibration, NominalRun
from flea_diag.core.evidence.friction import Friction
from flea_diag.core.run_law.fault_columns import FaultColumns, fault_columns
from flea_diag.core.run_law.law_columns import dry_friction, law_columns
from flea_diag.core.run_law.run_law import RunLaw
from flea_diag.core.run_law.run_windows import WINDOW_S, signal_names
from flea_diag.core.run_law.visible_sizes import (
    information,
    limit_nats,
    possible_sizes,
    size_along,
)
from flea_diag.tools.calibrate.law_windows import WindowItem, WindowWork
from flea_diag.tools.calibrate.limit_sizes import LimitWork
from flea_diag.tools.campaign.case import Case, Recipe
from flea_diag.tools.campaign.run_result import RunResult
from flea_diag.tools.evaluate.baselines import Setting, baseline
from flea_diag.tools.evaluate.case_run import diagnose, scored
from flea_diag.tools.main import main as flea
from flea_diag.tools.motion import speed
from flea_diag.tools.stand.simulate import write_bag
from flea_diag.wire.records import Record, Scan
from flea_sim_driver.faults import catalogue
from flea_sim_driver.scenario.flight_profiles import FLIGHT_PROFILES
from flea_sim_driver.scenario.flights import flight_scenario, flights
from flea_sim_driver.scenario.library import find_scenario
from flea_sim_driver.scenario.scenario_file import overridden
from flea_sim_driver.stand import SimulatedStand

Array = npt.NDArray[np.float64]
NOMINAL_SEEDS = range(101, 113)
EVERY = 4
STROKES = ("nominal", "nominal_loaded", "nominal_sweep", "nominal_trapezoid", "nominal_heavy",
           "nominal_pulled")  # fmt: skip
WIDTH = "friction_smooth_speed: {value: "
NARROWER = 0.1
"""The shipped 4 mm/s are an assumption; a count of the encoder is 0.08 mm/s over a scan."""
BRIDGE = {
    "\nparameters:\n": """\nparameters:
  drive_drop: {value: 0.3, unit: V, symbol: u_t, note: "assumption, dead time of the bridge"}
  drive_smooth_current: {value: 0.15, unit: A, symbol: i_s, note: "three times the noise"}
""",
    "\njunctions:\n": """\njunctions:
  drive: {type: "1", domain: electrical}
""",
    "\nelements:\n": """
elements:
  bridge: {type: R, law: dry, parameters: {level: drive_drop, smooth_flow: drive_smooth_current}}
""",
    "  - supply -> terminals\n": """  - supply -> drive
  - drive -> bridge
  - drive -> terminals
""",
    "offset: drive_offset, ": "offset: drive_offset, across: bridge, ",
    "  voltage_offset_v: 0.5\n": "  voltage_offset_v: 0.5\n  drive_drop_v: 0.1\n",
    "  drive_offset_v: drive_offset\n": """  drive_offset_v: drive_offset
  drive_drop_v: drive_drop
""",
}
"""Small strokes take small currents, by whose way the dead time of a bridge takes its part: left
out, it looks like a gain of the drive that differs by the size of the stroke. How much it takes,
the recordings say."""
DURATION_S, ONSET_S, FOLLOWED_S = 60.0, 20.0, 10.0
MOVES_M_S = 1e-3
TIMES, FAULTS_A_SEED = 2.0, 2
COUPLED = "coupled anew"
COUPLING = {"at_s": ONSET_S, "to": "Y", "magnet_s": 0.08}
"""The magnet of the unit in use lets go and pulls again, healthy."""
FAULTS: dict[str, dict[str, float]] = {
    "winding_short": {"resistance lost": 2.95, "constant lost": 1.0},
    "winding_resistance_rise": {"share gained": 1.0},
    "jam": {"coulomb drag": 58.0, "viscous drag": 2500.0},
    "motor_current_bias": {"bias": 1.0},
    "motor_current_scaling": {"scaling share": 1.0},
    "load_force_bias": {"bias": 1.0},
    "load_position_scaling": {"scaling share": 1.0},
}
"""Sizes in the law of a fault of size 1 of the simulator; a scaling of 1 is one by nothing."""


@dataclass(frozen=True)
class Flown:
    """One run: its fault with its size, the bounds there, and when it was found."""

    profile: str
    seed: int
    fault: str = ""
    size: float = math.nan
    bound: float = math.nan
    by_limits: float = math.nan
    largest: float = math.nan
    found_s: float = math.nan
    """After the onset, in seconds of motion; NaN: not."""
    outcome: str = ""
    group: str = ""
    before: bool = False
    """Whether something was called before the onset."""

    @property
    def quiet(self) -> bool:
        """Whether nothing was called."""
        return not self.before and math.isnan(self.found_s)


def prepare(folder: Path) -> int:
    """A stand for flights, with its calibration; the status of ``flea calibrate``."""
    shutil.copytree(ROOT / "config/stands/flea", folder)
    actuator = folder / "actuator.yaml"
    before, _, rest = actuator.read_text("utf-8").partition(WIDTH)
    value, _, after = rest.partition(",")
    text = f"{before}{WIDTH}{NARROWER * float(value)!r},{after}"
    for place, more in BRIDGE.items():
        assert text.count(place) == 1, place
        text = text.replace(place, more)
    actuator.write_text(text, "utf-8")
    bags = []
    for seed in NOMINAL_SEEDS:
        strokes = [overridden(find_scenario(name), "bench", {"seed": seed}) for name in STROKES]
        for scenario in (*strokes, *flights(seed)[seed % EVERY :: EVERY]):
            bags.append(folder / "bags" / f"{scenario.run.name}_{seed}")
            quiet = replace(scenario.sensors, vibration=False)
            write_bag(replace(scenario, sensors=quiet), bags[-1])
    made = folder / "calibration_simulated_stand.yaml"
    return flea(["calibrate", *map(str, bags), "--stand", str(folder), "-o", str(made), "--force"])


class Bounds:
    """Sizes of faults that a motion shows."""

    def __init__(self, stand: Stand) -> None:
        self.calibration: Calibration = learned(stand)
        law = self.calibration.law
        assert law is not None
        self._law: RunLaw = law
        work = WindowWork.of(self.calibration, str(stand.actuator), str(stand.faults))
        work = replace(work, relations=law.relations, travel=law.travel)
        effects, parameters = work.effects(), self.calibration.parameters
        known = effects.differences
        tolerance = dict(zip(known, self.calibration.differences(known), strict=True))
        free = described(str(stand.actuator)).free_per_run
        every = law_columns(effects, parameters, tolerance, law.relations, free)
        self._columns = every.some([every.names.index(term.name) for term in law.terms])
        models, predicted = effects.bound(parameters), effects.residuals.predictions
        self._faults: FaultColumns = fault_columns(
            models, law.relations, signal_names(effects), predicted
        )
        self._work, self._rows = work, effects.residuals
        dry = dry_friction(effects, parameters, law.relations)
        self._friction = Friction.of(dry, effects, law.usual_speed)

    def of(self, scans: Sequence[Scan], until_s: float) -> dict[str, tuple[float, float]]:
        """By the law and by the limits of the calibration, in the unit of the simulator."""
        rows = np.array([[scan.value(name) for name in self._rows.channels] for scan in scans])
        item = WindowItem(NominalRun("flight", rows), "")
        run = self._work.windows(item).part(slice(0, math.ceil(until_s / WINDOW_S)))
        onset, loud = round(ONSET_S / WINDOW_S), self._friction.loudness
        held = information(self._law, self._columns, self._faults, run, onset, loud)
        by_limits = LimitWork(self._work, self.calibration, self._faults).sizes(item)
        limit = limit_nats(self.calibration.false_alarms_per_hour, len(self._faults))
        return {fault: self._sizes(fault, sizes, held, by_limits, limit)
                for fault, sizes in FAULTS.items()}  # fmt: skip

    def _sizes(
        self, fault: str, sizes: Mapping[str, float], held: Array, by_limits: Array, limit: float
    ) -> tuple[float, float]:
        columns = self._faults.columns
        way = np.array([sizes.get(c.size, 0.0) if c.fault == fault else 0.0 for c in columns])
        assert way.any(), (fault, [c.size for c in columns if c.fault == fault])
        own = [k for k, column in enumerate(columns) if column.fault == fault]
        shown = {(row.fault, row.size): row.onset for row in self._law.visible}
        reach = possible_sizes(self._faults, np.array([shown[c.fault, c.size] for c in columns]))
        feigned = np.array([row.begun_sigma for row in self._law.feigned])
        block = held[np.ix_(own, own)]
        bound = float(size_along(block, reach[own], feigned[own], way[own], limit))
        with np.errstate(divide="ignore"):
            by_tests = np.where(way != 0.0, by_limits / np.abs(way), np.inf)
        return bound, float(by_tests.min())


def until(scans: Sequence[Scan]) -> tuple[Array, float]:
    """Seconds of motion before each scan, and when those after the onset are ``FOLLOWED_S``."""
    position = np.array([scan.value("actuator_position") for scan in scans])
    moving = np.abs(speed(0.01 * np.arange(len(scans)), position)) > MOVES_M_S
    motion = np.cumsum(moving) * 0.01
    onset = round(ONSET_S / 0.01)
    after = np.flatnonzero(motion - motion[onset] >= FOLLOWED_S)
    return motion, (after[0] if len(after) else len(scans)) * 0.01


def simulated(profile: str, seed: int, **values: Any) -> list[Record]:
    """Records of a flight without accelerometers."""
    given = {"duration_s": DURATION_S, "sensors": {"vibration": False}, **values}
    return list(SimulatedStand(flight_scenario(profile, seed, **given)))


@dataclass(frozen=True)
class Diagnoser:
    """A configuration of the diagnosis on a stand."""

    stand: Stand
    configuration: str

    def judged(self, records: Sequence[Record]) -> tuple[RunResult, dict[str, Any]]:
        """The diagnosis of a run."""
        stage = baseline(self.configuration).make(Setting(self.stand, (), None))
        done = diagnose(records, stage)
        return scored(Case("flight", "simulated", "", Recipe()), {}, done)


def flown(diagnoser: Diagnoser, bounds: Bounds, seed: int, faults: Sequence[str]) -> list[Flown]:
    """The healthy flight of a seed, and that with faults."""
    profile = FLIGHT_PROFILES[seed % len(FLIGHT_PROFILES)].name
    records = simulated(profile, seed)
    scans = [record for record in records if isinstance(record, Scan)]
    motion, end_s = until(scans)
    sizes = bounds.of(scans, end_s)
    rows = [_row(diagnoser, Flown(profile, seed), records, motion)]
    if seed % 2:
        coupled = simulated(profile, seed, switch=COUPLING)
        rows.append(_row(diagnoser, Flown(profile, seed, COUPLED), coupled, motion))
    for fault in faults:
        bound, by_limits = sizes[fault]
        one, neutral = TIMES * bound, float(fault.endswith("scaling"))
        largest = catalogue(flight_scenario(profile, seed).machine)[fault].maximum - neutral
        row = Flown(profile, seed, fault, one, bound, by_limits, largest)
        if not one < largest:
            rows.append(replace(row, outcome="beyond the catalogue"))
            continue
        setting = {"fault": fault, "onset_s": ONSET_S, "size": neutral + one}
        rows.append(_row(diagnoser, row, simulated(profile, seed, faults=[setting]), motion))
    return rows


def _row(diagnoser: Diagnoser, row: Flown, records: Sequence[Record], motion: Array) -> Flown:
    result, summary = diagnoser.judged(records)
    times = [episode["detected_at_s"] for episode in summary["episodes"]]
    onset = round(ONSET_S / 0.01)
    after = [t for t in times if t >= ONSET_S]
    found = motion[min(round(after[0] / 0.01), len(motion) - 1)] - motion[onset] if after else None
    told = replace(
        row, outcome=result.outcome, group=" ".join(result.group), before=len(after) < len(times),
        found_s=math.nan if found is None else float(found),
    )  # fmt: skip
    print(told, flush=True)
    return told


def figures_of(rows: Sequence[Flown], seeds: str) -> list[Figure]:
    """Shares of found faults, and of quiet healthy flights."""
    figures, alarmed = [], {row.seed for row in rows if not (row.fault or row.quiet)}
    for fault, words in (("", "quiet"), (COUPLED, "quiet while coupled anew")):
        healthy = [row for row in rows if row.fault == fault]
        if healthy:
            quiet = sum(row.quiet for row in healthy)
            figures.append(share(f"healthy flights {words}", quiet, len(healthy)))
    for fault in ("", *FAULTS):
        mine = [r for r in rows if r.fault in FAULTS and fault in ("", r.fault)]
        mine = [r for r in mine if r.size < r.largest]
        if mine:
            had = sum(row.found_s <= FOLLOWED_S and row.seed not in alarmed for row in mine)
            figures.append(share(f"found within 10 s of motion: {fault or 'all'}", had, len(mine)))
    return [replace(figure, seed=seeds) for figure in figures]


def main() -> int:
    """Fly, and print."""
    parser = bench_parser(__doc__)
    parser.add_argument("--seed", type=int, default=6000)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--stand", default="flea")
    parser.add_argument("--configuration", default="hybrid", choices=("hybrid", "evidence"))
    parser.add_argument("--prepare", type=Path, metavar="FOLDER")
    parser.add_argument("--faults", nargs="*", default=list(FAULTS), choices=FAULTS)
    given = parser.parse_args()
    if given.prepare:
        return prepare(given.prepare)
    stand = load_stand(given.stand)
    bounds, rows = Bounds(stand), []
    diagnoser = Diagnoser(stand, given.configuration)
    for seed in range(given.seed, given.seed + given.count):
        turn = [given.faults[(2 * seed + k) % len(given.faults)] for k in range(FAULTS_A_SEED)]
        rows += flown(diagnoser, bounds, seed, turn)
    figures = figures_of(rows, f"{given.seed} to {given.seed + given.count - 1}")
    for figure in figures:
        print(f"{figure.name}: {figure.value:.1f} {figure.unit}, n {figure.n}")
    write_summary("bench/faults/flights.py", figures, given.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
