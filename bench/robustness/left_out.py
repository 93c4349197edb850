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

"""Nominal recordings judged by calibrations made without them: alarms, and faults still found.

python bench/robustness/left_out.py       the FLEA's recordings below FLEA_DATA_DIR
python bench/robustness/left_out.py bags/* --part families

Each recording is left out by itself, then each family of one motion (sine1, trap3) together, then
the half of all recordings that reaches farthest in load, current, stroke or heat. What
is left out is diagnosed by a calibration from all others; an alarm is any episode. Its scans lie
within the envelope where every relation is tested, and where no limit grows besides. A calibration
without a family or a half also diagnoses every jam and every spall with ``--faults``: a jam is
found where ``jam`` is in the last group, a spall is right where no alarm is raised, for it does not
show in slow channels.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from robustness.promise import (
    STATED_PER_HOUR,
    diagnosed,
    diagnosis,
    episodes,
    imported,
    outside_s,
)
from summary import Figure, bench_parser, share, write_summary

from flea_diag.configuration.description import compiled_relations
from flea_diag.configuration.stand import load_stand
from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.conditions.envelope_watch import EnvelopeWatch
from flea_diag.core.residuals.residual_bank import ResidualBank
from flea_diag.tools.calibrate.calibrate import write_calibration
from flea_diag.tools.calibrate.nominal_recording import NominalRecording, read_nominal
from flea_diag.tools.calibrate.procedure import calibrate

PARTS = ("recordings", "families", "reaches")


def largest(readings: Any) -> float:
    """Largest magnitude, but for the spikes of a thousandth of the scans."""
    return float(np.quantile(np.abs(readings), 0.999))


REACHES: dict[str, tuple[str, Callable[[Any], Any]]] = {
    "load": ("load_force", largest),
    "current": ("motor_current", largest),
    "stroke": ("actuator_position", np.ptp),
    "heat": ("motor_temperature", np.median),
}


def family(name: str) -> str:
    """Motion that a recording is of: sine1 of BatchProfile_sine12_2010_..."""
    found = re.search(r"_([a-z]+\d)\d_", name)
    return found.group(1) if found else name


def reaching(recordings: list[NominalRecording], name: str) -> list[NominalRecording]:
    """The half of the recordings that reaches farthest."""
    channel, reach = REACHES[name]
    place = compiled_relations(load_stand().actuator).residuals.index[channel]

    def of(row: NominalRecording) -> float:
        readings = row.run.rows[:, place]
        return float(reach(readings[np.isfinite(readings)]))

    return sorted(recordings, key=of)[len(recordings) // 2 :]


def folds(recordings: list[NominalRecording], part: str) -> dict[str, list[NominalRecording]]:
    """What is left out together."""
    if part == "reaches":
        return {name: reaching(recordings, name) for name in REACHES}
    made: dict[str, list[NominalRecording]] = {}
    for row in recordings:
        name = row.run.name
        made.setdefault(name if part == "recordings" else family(name), []).append(row)
    return made


def covered(row: NominalRecording, calibration: Calibration) -> int:
    """Scans of a recording at which no limit grows."""
    c, known = calibration, calibration.envelope
    assert known is not None
    encoder = c.parameters.encoder_m_per_rad != 0.0
    relations = compiled_relations(load_stand().actuator, row.channels, encoder)
    bank = ResidualBank(c.parameters, relations, period_s=row.period_s, counts=c.counts)
    watch = EnvelopeWatch(known, relations, c.parameters, c.counts.kernel, row.period_s)
    watch.step(row.run.rows, bank.step(row.run.rows, frozen=False))
    beyond = watch.place.beyond
    return len(row.run.rows) - (0 if beyond is None else int((beyond > 0.0).any(axis=1).sum()))


def scored(
    recordings: list[NominalRecording], part: str, bags: dict[str, Path], faulty: list[Path]
) -> Iterator[Figure]:
    """Figures of one part."""
    quiet, hours, jams, spalls, inside = [0, 0], 0.0, [0, 0], [0, 0], [0, 0]
    outside = 0.0
    with TemporaryDirectory() as folder:
        for name, left in folds(recordings, part).items():
            rest = [row for row in recordings if row not in left]
            target = Path(folder, f"{name}.yaml")
            made = calibrate(rest, load_stand().actuator, STATED_PER_HOUR)
            write_calibration(target, made)
            for row in left:
                done = diagnosis(bags[row.run.name], target)
                groups, lasted_s = episodes(done), len(row.run.rows) * row.period_s
                outside += outside_s(done, lasted_s) / 3600.0
                quiet = [quiet[0] + (not groups), quiet[1] + 1]
                inside = [inside[0] + covered(row, made), inside[1] + len(row.run.rows)]
                hours += lasted_s / 3600.0
                for group in groups:
                    print(f"{row.run.name}: {group.opened_by}", flush=True)
            for bag in faulty if part != "recordings" else ():
                groups = diagnosed(bag, target)
                if "_Jam_" in bag.name:
                    found = bool(groups) and "jam" in {m.fault for m in groups[-1].members}
                    jams = [jams[0] + found, jams[1] + 1]
                else:
                    spalls = [spalls[0] + (not groups), spalls[1] + 1]
            print(f"without {name}: {quiet[0]} of {quiet[1]} quiet so far, jams {jams}", flush=True)
    yield share(f"left-out {part}: no alarm", *quiet)
    yield Figure(
        f"left-out {part}: false alarms", quiet[1] - quiet[0], f"in {hours:.3f} h", quiet[1]
    )
    tested = 100.0 * (1.0 - outside / hours)
    yield Figure(f"left-out {part}: scans with every relation tested", tested, "%", inside[1])
    alike = 100.0 * inside[0] / inside[1]
    yield Figure(f"left-out {part}: scans where no limit grows", alike, "%", inside[1])
    if jams[1]:
        yield share(f"left-out {part}: jam found", *jams)
        yield share(f"left-out {part}: spall without an alarm", *spalls)


def main() -> int:
    """Run and print."""
    parser = bench_parser(__doc__)
    parser.add_argument("bags", nargs="*", type=Path, help="bags")
    parser.add_argument("--part", choices=PARTS, action="append")
    parser.add_argument("--faults", action="store_true", help="diagnose jams and spalls, too")
    arguments = parser.parse_args()
    with TemporaryDirectory() as folder:
        given = arguments.bags or imported(Path(folder), "*")
        bags = {bag.name: bag for bag in given if "_Nominal_" in bag.name}
        faulty = [bag for bag in given if "_Jam_" in bag.name or "_Spall_" in bag.name]
        known = compiled_relations(load_stand().actuator).residuals
        recordings, _ = read_nominal(list(bags.values()), known)
        faulty = faulty if arguments.faults else []
        figures = [
            figure
            for part in arguments.part or PARTS
            for figure in scored(recordings, part, bags, faulty)
        ]
    for figure in figures:
        print(f"{figure.name}: {figure.value:g} {figure.unit} of {figure.n}")
    write_summary("left_out", figures, arguments.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
