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

"""One machine with fewer sensors: what is still found, what is said to be unseen, what is missed.

python bench/stands/bench_sensors.py                     the aileron drive, each sensor left out
python bench/stands/bench_sensors.py "no speed" --seed 40 --folder DIR

The recordings are those of bench_rates.py at 100 Hz. Of each set of sensors the stand is calibrated
anew on six healthy recordings without the others. A fault is found if it is in the final group, of
three at most, and was not detected before its onset; said, if the run ends NOMINAL and
`not_observable` names it; wrong, if a group is named without it; else missed. Faults of a sensor
that is left out are left out too.
"""

from __future__ import annotations

import json
import sys
import tempfile
from collections import Counter
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
from bench_rates import (
    FAULTS,
    FIRST_SEED,
    GROUP,
    HEALTHY,
    MACHINE,
    ONSET_S,
    UNIT,
    Figure,
    bench_parser,
    recorded,
    run,
    share,
    write_summary,
)

from flea_diag.wire.bags.bag import BagWriter, read_bag
from flea_diag.wire.records import ChannelTable, Scan

RATE_HZ = 100
LOAD = ("load_force", "commanded_load")
LEFT_OUT: dict[str, tuple[str, ...]] = {
    "all sensors": (),
    "no load cell, load commanded": LOAD[:1],
    "load unknown": LOAD,
    "no voltage": ("motor_voltage", "commanded_voltage"),
    "no speed": ("motor_speed",),
    "no temperature": ("motor_temperature", "ambient_temperature"),
    "no second position": ("surface_angle",),
    "current, position and speed alone": (
        *LOAD, "motor_voltage", "commanded_voltage", "motor_temperature", "ambient_temperature",
        "surface_angle",
    ),
}  # fmt: skip
"""Channels that a stand with fewer sensors lacks."""
GRADES = ("found", "said", "missed", "wrong")


def without(channels: tuple[str, ...], bag: Path, target: Path) -> None:
    """A bag as the same stand would have recorded it without these channels."""
    with BagWriter(target) as writer:
        for _, record in read_bag(bag):
            if isinstance(record, Scan):
                kept = [k for k, name in enumerate(record.channels) if name not in channels]
                record = replace(
                    record,
                    channels=tuple(record.channels[k] for k in kept),
                    values=tuple(record.values[k] for k in kept),
                )
            elif isinstance(record, ChannelTable):
                rows = tuple(row for row in record.channels if row.name not in channels)
                record = replace(record, channels=rows)
            writer.write(record)


def grade(fault: str, verdict: dict[str, object]) -> str:
    """One of ``GRADES``."""
    group, unseen = verdict["ambiguity_group"], verdict["not_observable"]
    assert isinstance(group, list)
    expected, start_s = set(FAULTS[fault][1]), verdict["detected_at_s"]
    if start_s is None:
        return "said" if fault in json.dumps(unseen) else "missed"
    if isinstance(start_s, float) and start_s < ONSET_S:
        return "wrong"
    if not group:
        return "missed"
    if not expected & set(group):
        return "wrong"
    return "found" if len(group) <= GROUP else "missed"


def of_sensors(name: str, seed: int, bags: Path, folder: Path) -> list[Figure]:
    """Figures with one set of sensors."""
    lacking = LEFT_OUT[name]
    for bag in sorted(bags.iterdir()):
        without(lacking, bag, folder / "bags" / bag.name)
    calibration, verdicts = folder / "calibration.yaml", folder / "verdicts.json"
    healthy = [folder / "bags" / f"healthy{motion}" for motion in HEALTHY]
    chosen = "--stand", MACHINE
    run("calibrate", *healthy, *chosen, "-o", calibration)
    faults = [fault for fault in FAULTS if not fault.startswith(lacking or ("-",))]
    names = ["test", "test_loaded", *faults]
    replayed = [folder / "bags" / each for each in names]
    run("replay", *replayed, *chosen, "--calibration", calibration, "--json", verdicts)
    found = dict(zip(names, json.loads(verdicts.read_text(encoding="utf-8")), strict=True))
    grades = {fault: grade(fault, found[fault]) for fault in faults}
    counts = Counter(grades.values())
    quiet = sum(found[each]["outcome"] == "NOMINAL" for each in names[:2])
    told = ", ".join(f"{counts[each]} {each}" for each in GRADES)
    print(f"{name}: {told} of {len(faults)}; {quiet} of 2 healthy runs NOMINAL")
    for fault, each in grades.items():
        if each != "found":
            verdict = found[fault]
            group = ", ".join(verdict["ambiguity_group"][:6])
            print(f"    {each}: {fault}: {verdict['outcome']} {verdict['detected_at_s']} {group}")
    seeds = f"unit {UNIT}, {seed} and on"
    return [
        *(share(f"{name}: {each}", counts[each], len(faults), seed=seeds) for each in GRADES),
        share(f"{name}: healthy runs NOMINAL", quiet, 2, seed=seeds),
    ]


def main() -> int:
    """Run and print."""
    parser = bench_parser(__doc__)
    parser.add_argument("sets", nargs="*", metavar="SET", help=", ".join(LEFT_OUT))
    parser.add_argument("--seed", type=int, default=FIRST_SEED, help="seed of the first run")
    parser.add_argument("--folder", type=Path, help="keep the recordings here")
    arguments = parser.parse_args()
    figures: list[Figure] = []
    with tempfile.TemporaryDirectory() as temporary:
        base = arguments.folder or Path(temporary)
        source = base / str(RATE_HZ)
        if not source.is_dir():
            source.mkdir(parents=True)
            recorded(RATE_HZ, arguments.seed, source)
        for name in arguments.sets or LEFT_OUT:
            folder = base / name.replace(" ", "_").replace(",", "")
            figures += of_sensors(name, arguments.seed, source / "bags", folder)
    write_summary("bench/stands/bench_sensors.py", figures, arguments.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
