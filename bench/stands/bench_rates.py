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

"""One machine scanned at 25 Hz to 1 kHz: its faults are found after the same time at any rate.

python bench/stands/bench_rates.py                 the aileron drive at five rates
python bench/stands/bench_rates.py 25 1000         these rates alone
python bench/stands/bench_rates.py 200 --seed 40 --folder DIR

At each rate the same unit makes six healthy recordings, from which its stand is calibrated, two
more healthy runs, and one run of each fault. A run is right if the fault is in the final group, of
three at most, and was not detected before its onset. The simulated DAQ has no 25 Hz: every second
scan of 50 Hz makes them.
"""

from __future__ import annotations

import io
import json
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

import yaml

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from summary import ROOT, Figure, bench_parser, share, write_summary

from flea_diag.tools.main import main as flea
from flea_diag.wire.bags.bag import BagWriter, read_bag
from flea_diag.wire.records import Scan

RATES_HZ = (25, 50, 100, 200, 1000)
SLOWEST_HZ = 50
"""Slowest rate of the simulated DAQ."""
MACHINE, UNIT, FIRST_SEED, ONSET_S, GROUP = "wing", 31, 20, 12.0, 3
HEALTHY = ("", "_loaded", "_heavy", "_pulled", "_trapezoid", "_sweep")
FAULTS: dict[str, tuple[float | None, tuple[str, ...]]] = {
    "jam": (1.2, ("jam", "ball_nut_friction")),
    "ball_nut_friction": (2.0, ("jam", "ball_nut_friction")),
    "winding_short": (0.2, ("winding_short",)),
    "winding_resistance_rise": (0.35, ("winding_resistance_rise",)),
    "magnet_loss": (0.15, ("magnet_loss",)),
    "supply_sag": (0.2, ("supply_sag", "weak_drive")),
    "motor_current_bias": (1.4, ("motor_current_bias",)),
    "motor_current_scaling": (1.25, ("motor_current_scaling",)),
    "motor_speed_bias": (16.0, ("motor_speed_bias",)),
    "load_force_bias": (1000.0, ("load_force_bias",)),
    "motor_temperature_bias": (7.0, ("motor_temperature_bias", "motor_temperature_scaling")),
    "actuator_position_dead": (None, ("actuator_position_dead",)),
}
"""Size of each fault, in the middle of its row of config/campaigns/wing.yaml, and what is right."""


def machine_at(rate_hz: int, folder: Path) -> Path:
    """File of the machine with another rate of scans."""
    content = (ROOT / f"config/machines/{MACHINE}.yaml").read_text(encoding="utf-8")
    path = folder / f"{MACHINE}.yaml"
    rate = f"scan_rate_hz: {float(max(rate_hz, SLOWEST_HZ))}"
    path.write_text(content.replace("scan_rate_hz: 100.0", rate), encoding="utf-8")
    return path


def scenarios() -> Iterator[tuple[str, dict[str, Any]]]:
    """Name and content of every run."""
    folder = ROOT / "config/scenarios" / MACHINE
    for name in HEALTHY:
        shipped = yaml.safe_load((folder / f"nominal{name}.yaml").read_text(encoding="utf-8"))
        yield f"healthy{name}", shipped
        if name in ("", "_loaded"):
            yield f"test{name}", shipped
        if name == "_heavy":
            for fault, (size, _) in FAULTS.items():
                row = {"fault": fault, "onset_s": ONSET_S}
                yield fault, {**shipped, "faults": [row | ({"size": size} if size else {})]}


def thinned(bag: Path, target: Path) -> None:
    """Every second scan of a bag."""
    count = 0
    with BagWriter(target) as writer:
        for _, record in read_bag(bag):
            if isinstance(record, Scan):
                count += 1
                if count % 2:
                    continue
            writer.write(record)


def recorded(rate_hz: int, seed: int, folder: Path) -> Path:
    """Bags of all runs at a rate."""
    machine = machine_at(rate_hz, folder)
    for number, (name, content) in enumerate(scenarios()):
        path = folder / f"{name}.yaml"
        path.write_text(yaml.safe_dump({**content, "seed": seed + number}), encoding="utf-8")
        bag = folder / ("fast" if rate_hz < SLOWEST_HZ else "bags") / name
        run("simulate", path, "--machine", machine, "--unit-seed", UNIT, "-o", bag)
        if rate_hz < SLOWEST_HZ:
            thinned(bag, folder / "bags" / name)
    return folder / "bags"


def run(*arguments: object) -> float:
    """CPU time of a command in s."""
    begin_s = time.process_time()
    with redirect_stdout(io.StringIO()):
        status = flea([*map(str, arguments)])
    if status:
        sys.exit(f"flea {' '.join(map(str, arguments))}: exit status {status}")
    return time.process_time() - begin_s


def at(rate_hz: int, seed: int, folder: Path) -> list[Figure]:
    """Figures of one rate."""
    bags = recorded(rate_hz, seed, folder)
    calibration, verdicts = folder / "calibration.yaml", folder / "verdicts.json"
    healthy = [bags / f"healthy{name}" for name in HEALTHY]
    learning_s = run("calibrate", *healthy, "--stand", MACHINE, "-o", calibration)
    names = ["test", "test_loaded", *FAULTS]
    chosen = "--stand", MACHINE, "--calibration", calibration
    replay_s = run("replay", *(bags / name for name in names), *chosen, "--json", verdicts)
    found = dict(zip(names, json.loads(verdicts.read_text(encoding="utf-8")), strict=True))
    right, delays = 0, []
    for fault, (_, expected) in FAULTS.items():
        verdict = found[fault]
        group = verdict["ambiguity_group"]
        start_s = verdict["detected_at_s"]
        detected = start_s is not None and start_s >= ONSET_S
        good = detected and bool(set(group) & set(expected)) and len(group) <= GROUP
        right += good
        delays += [start_s - ONSET_S] if detected else []
        if not good:
            print(
                f"    {rate_hz} Hz, {fault}: {verdict['outcome']} {start_s} {', '.join(group[:6])}"
            )
    quiet = sum(found[name]["outcome"] == "NOMINAL" for name in ("test", "test_loaded"))
    seeds = f"unit {UNIT}, {seed} and on"
    middle = sorted(delays)[len(delays) // 2] if delays else float("nan")
    recorded_s = sum(found[name]["duration_s"] for name in names)
    print(
        f"{rate_hz:5d} Hz  {right:2d} of {len(FAULTS)} right, {len(delays)} detected after a "
        f"median of {middle:.2f} s, {quiet} of 2 healthy runs NOMINAL; "
        f"calibration {learning_s:.1f} s of CPU, replay {recorded_s / replay_s:.0f} times real time"
    )
    return [
        share(f"{rate_hz} Hz: fault in a group of at most 3", right, len(FAULTS), seed=seeds),
        Figure(f"{rate_hz} Hz: detected after", middle, "s", len(delays), seed=seeds),
        share(f"{rate_hz} Hz: healthy runs NOMINAL", quiet, 2, seed=seeds),
        Figure(f"{rate_hz} Hz: calibration", learning_s, "s of CPU", len(HEALTHY), seed=seeds),
        Figure(
            f"{rate_hz} Hz: replay over real time, CPU",
            recorded_s / replay_s,
            "",
            len(names),
            seed=seeds,
        ),
    ]


def main() -> int:
    """Run and print."""
    parser = bench_parser(__doc__)
    parser.add_argument("rates", nargs="*", type=int, choices=[*RATES_HZ, []], metavar="HZ")
    parser.add_argument("--seed", type=int, default=FIRST_SEED, help="seed of the first run")
    parser.add_argument("--folder", type=Path, help="keep the recordings here")
    arguments = parser.parse_args()
    figures: list[Figure] = []
    for rate_hz in arguments.rates or RATES_HZ:
        with tempfile.TemporaryDirectory() as temporary:
            folder = (arguments.folder or Path(temporary)) / str(rate_hz)
            folder.mkdir(parents=True, exist_ok=True)
            figures += at(rate_hz, arguments.seed, folder)
    write_summary("bench/stands/bench_rates.py", figures, arguments.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
