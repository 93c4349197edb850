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

"""Makes the bags beside this file, and what is expected of them in test/expected_decisions.

    .venv/bin/python bags/make.py                 whatever has changed: bags, then decisions
    .venv/bin/python bags/make.py --expected      decisions only, of the bags as they are
    .venv/bin/python bags/make.py jam nominal     these bags and their decisions

A simulated bag is made anew each time and comes out byte for byte the same while the simulator
is the same. The live one differs each time; it is flown again when a replay no longer gives
the decisions that were published when it was recorded, or when it is named.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent), str(HERE.parent / "test")]

from support.decisions import expected, write_expected

from flea_diag.configuration.component import make_pipeline
from flea_diag.configuration.stand import load_stand
from flea_diag.tools.main import main as flea
from flea_diag.tools.replay.replay import replay
from flea_diag.wire.bags.bag import BagReader, BagWriter
from flea_diag.wire.records import ChannelTable, FeatureRequest, Scan, VibrationBlock

LARGEST_BYTES = 1_000_000
BLOCK_NS = 100_000_000

SIMULATED = {
    "nominal": "nominal --seed 21 --duration 16 --no-vibration",
    "jam": "nominal --seed 22 --duration 16 --fault jam --at 8",
    "winding_short": "nominal --seed 23 --duration 24 --fault winding_short --at 8 --no-vibration",
    "motor_temperature_drift": "nominal --seed 24 --duration 20 --fault motor_temperature_drift "
    "--at 8 --no-vibration",
    "unit_switch_jam": "unit_switch_jam --duration 22 --no-vibration",
}
"""Bag -> arguments of `flea simulate`."""

LIVE = {
    "live_motor_current_bias": "--headless --scenario bags/slow.yaml --seed 25 "
    "--fault motor_current_bias --at 8 --for 13",
}
"""Bag -> arguments of `scripts/run`."""


def main() -> int:
    """Make them; 1 when a bag is too large."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("bags", nargs="*", metavar="BAG", help=", ".join((*SIMULATED, *LIVE)))
    parser.add_argument("--expected", action="store_true", help="renew only what is expected")
    options = parser.parse_args()
    unknown = set(options.bags) - {*SIMULATED, *LIVE}
    if unknown:
        parser.error(f"no such bag: {', '.join(sorted(unknown))}")
    names = options.bags or [*SIMULATED, *LIVE]
    if not options.expected:
        for name in names:
            make(name, named=name in options.bags)
    for name in names:
        renew(name)
    return max(too_large(name) for name in names)


def make(name: str, named: bool) -> None:
    """Make one bag; the live one only where it has to be."""
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / name
        if name in SIMULATED:
            simulate(name, made)
        elif named or not still_holds(name):
            fly(name, made)
        if made.exists():
            shutil.rmtree(HERE / name, ignore_errors=True)
            shutil.copytree(made, HERE / name)


def simulate(name: str, made: Path) -> None:
    """Simulate into a bag; of vibration it keeps what the lazy features asked for."""
    arguments = SIMULATED[name].split()
    if "--no-vibration" in arguments:
        done = flea(["simulate", *arguments, "-o", str(made)])
    else:
        whole = made.with_name("whole")
        done = flea(["simulate", *arguments, "-o", str(whole)])
        cut(whole, made)
    if done != 0:
        raise SystemExit(f"{name}: not simulated")


def cut(whole: Path, made: Path) -> None:
    """Copy a bag without the vibration that no feature was computed on: 1 s is half a megabyte."""
    records = [record for _, record in BagReader(whole).records()]
    windows = list(asked_for(records))
    with BagWriter(made, whole_every_s=None) as bag:
        for record in records:
            if not isinstance(record, VibrationBlock) or any(
                start - BLOCK_NS <= record.stamp_ns <= end for start, end in windows
            ):
                bag.write(record)


def asked_for(records: list[Any]) -> Iterator[tuple[int, int]]:
    """Windows of the features that a diagnosis of these records asks for."""
    pipeline = make_pipeline(load_stand())
    for record in records:
        if isinstance(record, (ChannelTable, VibrationBlock, Scan)):
            for caused in pipeline.handle(record):
                if isinstance(caused, FeatureRequest):
                    yield caused.window_start_ns, caused.window_end_ns


def still_holds(name: str) -> bool:
    """Whether a replay gives the decisions that were published when the bag was recorded."""
    if not (HERE / name).exists():
        return False
    summary = replay(HERE / name, make_pipeline(load_stand()))
    return bool(summary["decision_digest"] == summary["recorded_decision_digest"])


def fly(name: str, made: Path) -> None:
    """Record a live run over DDS."""
    command = [sys.executable, "-m", "flea_diag.nodes.run.live_run", *LIVE[name].split()]
    given = {**os.environ, "PYTHONPATH": str(HERE.parent)}
    done = subprocess.run([*command, "--bag", str(made)], cwd=HERE.parent, env=given, check=False)
    if done.returncode != 0:
        raise SystemExit(f"{name}: the live run was not right, no new bag")


def renew(name: str) -> None:
    """Expect what a replay says now, and say what that is."""
    path = HERE / name
    summary = replay(path, make_pipeline(load_stand()))
    try:
        before = expected(name)
    except FileNotFoundError:
        before = {}
    write_expected(name, summary)
    changed = "" if expected(name) == before else " (changed)"
    group = ", ".join(summary["ambiguity_group"]) or "-"
    print(f"{name}: {size(name)} bytes; {summary['outcome']}: {group}{changed}")


def size(name: str) -> int:
    """Bytes of a bag."""
    return sum(file.stat().st_size for file in (HERE / name).iterdir())


def too_large(name: str) -> int:
    """1 for a bag over the limit."""
    if size(name) <= LARGEST_BYTES:
        return 0
    print(f"{name}: over {LARGEST_BYTES} bytes: shorten it", file=sys.stderr)
    return 1


if __name__ == "__main__":
    sys.exit(main())
