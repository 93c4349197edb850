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

"""Healthy running that no calibration has seen: false alarms and abstention, on three machines.

python bench/robustness/healthy.py                    10 runs of each kind and machine, 60 s each
python bench/robustness/healthy.py 40 --machine ema --seed 9700

Every run is of a unit of its own. One kind is drawn as the recordings of the calibrations are; the
others go beyond them in one way each (motion, rests, load up to 1.5 times, ends of travel, room and
motor temperature, a voltage that is bad in stretches and that no command corroborates), the last in
all of them. An alarm is an episode that is not taken back. Abstention is the share of scans with a
relation that is not tested for lying outside the calibration.
"""

from __future__ import annotations

import json
import sys
import tempfile
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import yaml

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from robustness.promise import outside_s
from summary import Figure, bench_parser, write_summary

from flea_diag.configuration.component import make_pipeline
from flea_diag.configuration.stand import Stand, load_stand
from flea_diag.core.residuals.channel_units import COMMAND, VOLTAGE
from flea_diag.errors import ConfigurationError
from flea_diag.tools.evaluate.case_run import diagnose
from flea_diag.wire.records import TAKEN_BACK, AmbiguityGroup, Detection, Scan
from flea_sim_driver.machine.library import find_machine
from flea_sim_driver.machine.machine import Machine
from flea_sim_driver.scenario.scenario_file import scenario_from_mapping
from flea_sim_driver.stand import SimulatedStand

SCORED_SEED = 9700
MACHINES = ("flea", "ema", "wing")
DURATION_S, MORE_LOAD = 60.0, 1.5
Values = dict[str, Any]
Draw = np.random.Generator


def drawn_motion(draw: Draw, machine: Machine, wider: float = 1.0) -> Values:
    """A motion as calibrations have it, or wider by up to this factor in each of its numbers."""
    of, kind = machine.drawn, ("sine", "trapezoid", "triangle", "sweep")[int(draw.integers(4))]
    scale = lambda: float(np.exp(draw.uniform(-np.log(wider), np.log(wider))))  # noqa: E731
    amplitude = float(draw.uniform(*of.amplitude_m)) * scale()
    motion: Values = {"kind": kind, "amplitude_m": round(amplitude, 5)}
    motion["centre_m"] = round(float(draw.uniform(*of.centre_m)), 5)
    if kind == "trapezoid":
        motion |= {"frequency_hz": round(float(draw.uniform(*of.trapezoid_hz)) / wider, 4)}
        return motion | {"rise_s": of.rise_s * max(scale(), 1.0)}
    fastest = of.speed_m_s / (2.0 * np.pi * amplitude)
    fast = round(min(float(draw.uniform(*of.frequency_hz)) * scale(), fastest), 4)
    if kind == "sweep":
        return motion | {"frequency_hz": of.sweep_from_hz / wider, "end_frequency_hz": fast}
    return motion | {"frequency_hz": fast}


def _inside(draw: Draw, machine: Machine) -> Values:
    """As the recordings of the shipped calibrations are drawn."""
    load = float(draw.uniform(-1.0, 1.0)) * machine.limits.load_n
    return {
        "motion": drawn_motion(draw, machine),
        "load": {"constant_n": round(load, 1)},
        "ambient_degc": round(float(draw.uniform(20.0, 27.0)), 1),
        "warm_degc": round(float(draw.uniform(0.0, 10.0)), 1),
    }


def _other_motion(draw: Draw, machine: Machine) -> Values:
    """Wider and narrower, slower and faster."""
    return {"motion": drawn_motion(draw, machine, 1.5)}


def _rests(draw: Draw, machine: Machine) -> Values:
    """Long rests under load between short ways, or nothing but rest."""
    still = draw.random() < 0.25
    motion = drawn_motion(draw, machine) | {"kind": "hold" if still else "trapezoid"}
    motion |= {"rise_s": machine.drawn.rise_s, "frequency_hz": round(draw.uniform(0.012, 0.04), 4)}
    motion.pop("end_frequency_hz", None)
    return {"motion": motion}


def _more_load(draw: Draw, machine: Machine) -> Values:
    """Up to ``MORE_LOAD`` times the load of the calibration, constant or swinging."""
    most = machine.limits.load_n
    peak = most * float(draw.uniform(1.0, MORE_LOAD)) * (1.0 if draw.random() < 0.5 else -1.0)
    if draw.random() < 0.5:
        return {"load": {"constant_n": round(peak, 1)}}
    swing = abs(peak) * float(draw.uniform(0.3, 0.9))
    middle = round(float(np.copysign(abs(peak) - swing, peak)), 1)
    row = {"constant_n": middle, "amplitude_n": round(swing, 1)}
    return {"load": row | {"frequency_hz": round(float(draw.uniform(0.02, 0.2)), 3)}}


def _ends(draw: Draw, machine: Machine) -> Values:
    """To an end of travel, or against the stop there."""
    stroke, of = machine.limits.stroke_m, machine.drawn
    amplitude = round(float(draw.uniform(*of.amplitude_m)), 5)
    past = float(draw.uniform(-0.1, 0.5)) * amplitude
    near = amplitude - past
    fastest = of.speed_m_s / (2.0 * np.pi * amplitude)
    fast = round(min(float(draw.uniform(*of.frequency_hz)), fastest), 4)
    motion = {"kind": "sine", "amplitude_m": amplitude, "frequency_hz": fast}
    motion["centre_m"] = round(stroke - near if draw.random() < 0.5 else near, 5)
    stopped = "nut" if draw.random() < 0.5 else "load_side"
    travel = {"stopped": stopped, "overtravel_m": 0.5 * amplitude, "high_m": stroke}
    return {"motion": motion, "travel": travel}


def _temperature(draw: Draw, machine: Machine) -> Values:
    """A cold or a hot room, and a motor that has run."""
    return {
        "ambient_degc": round(float(draw.uniform(5.0, 40.0)), 1),
        "warm_degc": round(float(draw.uniform(0.0, 30.0)), 1),
    }


KINDS: dict[str, tuple[Callable[[Draw, Machine], Values], ...]] = {
    "as calibrated": (),
    "other motions": (_other_motion,),
    "rests": (_rests,),
    "more load": (_more_load,),
    "ends of travel": (_ends,),
    "temperature": (_temperature,),
    "bad voltage": (),
    "all at once": (_other_motion, _more_load, _ends, _temperature),
}
BAD_VOLTAGE = ("bad voltage", "all at once")


@dataclass(frozen=True)
class Judged:
    """One run: its alarms, and the share of scans with a relation outside the calibration."""

    machine: str
    kind: str
    number: int
    alarms: tuple[str, ...]
    taken_back: int
    abstained: float
    last: str


def scenario(
    draw: Draw, kind: str, machine: Machine, file: str, given: Values | None = None
) -> Any:
    """A healthy run of this kind, but for what is ``given``.

    Draws that the machine cannot run are drawn anew.
    """
    for _ in range(50):
        values: Values = {
            "machine": file,
            "duration_s": DURATION_S,
            "seed": int(draw.integers(2**31)),
        }
        values |= {"sensors": {"vibration": False}} | _inside(draw, machine)
        for beyond in KINDS[kind]:
            values |= beyond(draw, machine)
        values |= given or {}
        try:
            return scenario_from_mapping(values, kind)
        except ConfigurationError:
            continue
    raise ConfigurationError(f"{machine.name}: no run of kind {kind!r} can be drawn")


def bad_in_stretches(draw: Draw, records: list[Any]) -> list[Any]:
    """The voltage stands at the supply in stretches, and no command corroborates it."""
    scans = [record for record in records if isinstance(record, Scan)]
    channels = scans[0].channels
    if VOLTAGE not in channels:
        return records
    bad = np.zeros(len(scans), dtype=bool)
    for _ in range(int(draw.integers(1, 5))):
        start = int(draw.integers(len(scans)))
        bad[start : start + int(draw.integers(20, 600))] = True
    volts = [scan.values[channels.index(VOLTAGE)] for scan in scans]
    supply = float(np.copysign(1.2 * np.abs(volts).max(), draw.normal()))
    changed = {}
    for scan, is_bad in zip(scans, bad.tolist(), strict=True):
        known = dict(zip(channels, scan.values, strict=True))
        known |= {VOLTAGE: supply} if is_bad else {}
        known |= {COMMAND: float("nan")} if COMMAND in known else {}
        changed[id(scan)] = replace(scan, values=tuple(known.values()))
    return [changed.get(id(record), record) for record in records]


def diagnosed(stand: Stand, records: list[Any]) -> tuple[tuple[str, ...], int, float, str]:
    """Alarms in words, how many were taken back, share of time outside, the last outcome."""
    done = diagnose(records, make_pipeline(stand))
    groups = [record for record in done.kept if isinstance(record, AmbiguityGroup)]
    detections = [record for record in done.kept if isinstance(record, Detection)]
    last = {group.episode: group for group in groups if group.episode}
    words = [
        f"{g.opened_by} at {(g.detected_stamp_ns - done.start_ns) / 1e9:.1f} s: {g.outcome.name} "
        f"{[member.fault for member in g.members][:4]}"
        for g in last.values()
    ]
    back = sum(TAKEN_BACK in detection.test for detection in detections)
    share = outside_s(done, DURATION_S) / DURATION_S
    return tuple(words), back, share, groups[-1].outcome.name


def wider(name: str, folder: Path) -> str:
    """File of the machine with a load actuator that is ``MORE_LOAD`` times as strong."""
    source = Path(__file__).parents[2] / "config" / "machines" / f"{name}.yaml"
    content = yaml.safe_load(source.read_text(encoding="utf-8"))
    content["limits"]["load_n"] *= MORE_LOAD
    target = folder / f"{name}.yaml"
    target.write_text(yaml.safe_dump(content), encoding="utf-8")
    return str(target)


def judged(stand: Stand, machine: Machine, file: str, kind: str, number: int, seed: int) -> Judged:
    """Simulate and diagnose one run."""
    kinds, machines = list(KINDS), MACHINES
    draw = np.random.default_rng((seed, machines.index(machine.name), kinds.index(kind), number))
    records = list(SimulatedStand(scenario(draw, kind, machine, file)))
    if kind in BAD_VOLTAGE:
        records = bad_in_stretches(draw, records)
    return Judged(machine.name, kind, number, *diagnosed(stand, records))


def report(runs: list[Judged], name: str) -> list[Figure]:
    """Alarms an hour and abstention of some runs."""
    hours = len(runs) * DURATION_S / 3600.0
    alarms = sum(len(run.alarms) - run.taken_back for run in runs)
    outside = float(np.mean([run.abstained for run in runs]))
    print(
        f"{name:26s} {alarms:3d} alarms in {hours:6.2f} h, {outside:5.1%} outside the calibration"
    )
    n = len(runs)
    return [
        Figure(f"{name}: false alarms", alarms / hours, "per hour", n),
        Figure(f"{name}: outside the calibration", 100.0 * outside, "%", n),
    ]


def main() -> int:
    """Run and print."""
    parser = bench_parser(__doc__)
    parser.add_argument("runs", nargs="?", type=int, default=10, help="of each kind and machine")
    parser.add_argument("--seed", type=int, default=SCORED_SEED)
    parser.add_argument("--machine", choices=MACHINES, action="append")
    parser.add_argument("--kind", choices=list(KINDS), action="append")
    parser.add_argument("--calibration", help="file in place of the shipped one")
    parser.add_argument("--log", type=Path, help="JSON Lines, one a run")
    arguments = parser.parse_args()
    found: list[Judged] = []
    with tempfile.TemporaryDirectory() as folder:
        prepared = [
            partial(judged, load_stand(name, calibration=arguments.calibration or ""),
                    find_machine(name), wider(name, Path(folder)))
            for name in arguments.machine or MACHINES
        ]  # fmt: skip
        for number in range(arguments.runs):
            for kind in arguments.kind or KINDS:
                for run in prepared:
                    found.append(run(kind, number, arguments.seed))
                    line = json.dumps(asdict(found[-1]))
                    print(line, file=sys.stderr, flush=True)
                    if arguments.log:
                        with arguments.log.open("a", encoding="utf-8") as log:
                            log.write(line + "\n")
    figures = []
    for machine in arguments.machine or MACHINES:
        own = [run for run in found if run.machine == machine]
        for kind in arguments.kind or KINDS:
            figures += report([run for run in own if run.kind == kind], f"{machine}, {kind}")
        figures += report(own, machine)
    write_summary("healthy", figures, arguments.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
