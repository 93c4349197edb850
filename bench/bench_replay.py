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

"""Speed of a replay from the bag to the verdict on one core, relative to real time.

Simulated recordings at 100 Hz without vibration, healthy and with a jam. ``singly`` processes
record by record instead of blocks. Both are measured in turns, in CPU time.

Then the command as typed, with its start: the same bags through one ``flea replay``, with ``-j 2``,
a single bag; beside them the replay function alone, in this process. Of other recordings with
``--bags BAG... --calibration FILE``; ``--copies N`` adds so many copies of them, each channel with
a gain of its own that nobody has seen before, a part in a million off one.

At the end what a start takes, of ``flea --help`` and of one bag, in starts of Python with numpy: a
ratio of pairs, which other work on the machine moves less than seconds.

What is typed does not find the package ``coverage``, which the tests need and an installed package
does not bring: numba would import it at every start.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from bench_scan import KINDS, pipeline, recording
from summary import Figure, bench_parser, write_summary

from flea_diag.tools.garbage import search_less

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
SECONDS = 120
TURNS = 3
TYPED_BAGS, TYPED_TURNS = 24, 5
TYPED_SECONDS = 30
PERIOD_S = 0.01
FLEA = (sys.executable, "-m", "flea_diag.tools.main")
GAIN_ERROR = 1e-6
"""Of the channels of a copy: far below a count of any sensor, so that decisions are alike."""
WITHOUT_TESTS = Path(__file__).parent / "without_tests"
INSTALLED = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
INSTALLED["PYTHONPATH"] = os.pathsep.join(
    filter(None, (str(WITHOUT_TESTS), os.environ.get("PYTHONPATH")))
)
"""What is typed runs from bytecode and without packages of the tests, as an installed one does."""


def in_blocks(bag: Path, kind: str, backend: str) -> tuple[float, str, int]:
    """CPU time, s, of the replay function of the command, digest, and number of scans."""
    from flea_diag.tools.replay.replay import replay

    stage = pipeline(kind, backend)
    begin = time.process_time()
    summary = replay(bag, stage)
    return time.process_time() - begin, summary["digest"], summary["scans"]


def singly(bag: Path, kind: str, backend: str) -> tuple[float, str]:
    """The same, record by record."""
    from flea_diag.stages.digest import digest
    from flea_diag.wire.bags.bag import BagReader
    from flea_diag.wire.records import ChannelTable, Scan

    stage = pipeline(kind, backend)
    begin = time.process_time()
    said = []
    for _, record in BagReader(bag).records((ChannelTable, Scan)):
        said += stage.handle(record)
    found = digest([*said, *stage.finish()])
    return time.process_time() - begin, found


def compared(bag: Path, kind: str, backend: str) -> tuple[float, float]:
    """Speed relative to real time in blocks and singly; the digests must be equal."""
    spent, count = [], 0
    for _ in range(TURNS):
        quick, one, count = in_blocks(bag, kind, backend)
        slow, other = singly(bag, kind, backend)
        if one != other:
            raise SystemExit(f"{bag.name}, {kind}: the digests differ")
        spent.append((quick, slow))
    quick, slow = np.median(spent, axis=0)
    return count * PERIOD_S / float(quick), count * PERIOD_S / float(slow)


class Spent(NamedTuple):
    """CPU time and time on the clock, s."""

    cpu: float
    wall: float


def typed(*arguments: str) -> Spent:
    """Of one ``flea`` command in a process of its own, with those that it starts."""
    return started(*FLEA, *arguments)


def started(*command: str) -> Spent:
    """Of a process, with those that it starts."""
    begin, before = time.monotonic(), os.times()
    subprocess.run(command, check=False, stdout=subprocess.DEVNULL, env=INSTALLED)
    after = os.times()
    cpu = after.children_user + after.children_system - before.children_user
    return Spent(cpu - before.children_system, time.monotonic() - begin)


def inside(bags: Sequence[str], calibration: str) -> tuple[Spent, float]:
    """Of the replay function on all bags, in this process; the duration of the recordings, s."""
    from flea_diag.configuration.component import make_pipeline
    from flea_diag.configuration.stand import load_stand
    from flea_diag.tools.replay.replay import replay

    stand = load_stand("", calibration=calibration)
    begin, clock = time.process_time(), time.monotonic()
    seconds = sum(replay(Path(bag), make_pipeline(stand))["duration_s"] for bag in bags)
    return Spent(time.process_time() - begin, time.monotonic() - clock), seconds


def simulated(folder: Path) -> list[str]:
    """Recordings of different units, every third with a jam from half way."""
    jam = ("--fault", "jam", "--at", str(TYPED_SECONDS // 2))
    return [
        str(recording(folder, TYPED_SECONDS, *(jam if seed % 3 == 0 else ()), "--seed", str(seed)))
        for seed in range(100, 100 + TYPED_BAGS)
    ]


def perturbed(bags: Sequence[str], count: int, folder: Path) -> list[str]:
    """Copies of recordings in turn, with gains drawn anew each time."""
    from flea_diag.wire.bags.bag import BagReader, BagWriter
    from flea_diag.wire.records import Scan

    generator, made = np.random.default_rng(), []
    for number in range(count):
        source = Path(bags[number % len(bags)])
        made.append(str(folder / f"copy_{number}_{source.name}"))
        gains = 0.0
        with BagWriter(made[-1], whole_every_s=None) as bag:
            for log_ns, record in BagReader(source).records():
                if isinstance(record, Scan):
                    if isinstance(gains, float):
                        gains = 1.0 + GAIN_ERROR * generator.standard_normal(len(record.values))
                    record = replace(record, values=tuple((gains * record.values).tolist()))
                bag.write(record, log_ns)
    return made


def as_typed(bags: Sequence[str], calibration: str, turns: int = TYPED_TURNS) -> list[Figure]:
    """The command against the function inside it, medians of interleaved turns."""
    option = ("--calibration", calibration, "-q")
    inside(bags[:2], calibration)  # what is loaded once is not part of it
    typed("replay", bags[0], *option)
    rows = []
    for _ in range(turns):
        own, seconds = inside(bags, calibration)
        one, two = typed("replay", *bags, *option), typed("replay", *bags, *option, "-j", "2")
        single = typed("replay", bags[0], *option)
        rows.append((
            seconds / own.cpu, seconds / one.cpu, own.cpu / one.cpu, one.wall / two.wall,
            single.cpu, single.wall,
        ))  # fmt: skip
    count = f"{len(bags)} bags"
    names = (
        (f"{count}, inside", "x real time", ""),
        (f"{count}, as typed", "x real time", ""),
        (f"{count}, as typed, of the rate inside", "x", "the replay function alone"),
        (f"{count}, as typed with -j 2", "x", "one process, on the clock"),
        ("one bag, as typed, CPU time", "s", ""),
        ("one bag, as typed, on the clock", "s", ""),
    )
    figures = middles(names, rows) + starts(bags[0], option, turns)
    print(f"load average {os.getloadavg()[0]:.1f}")
    return figures


def starts(bag: str, option: Sequence[str], turns: int) -> list[Figure]:
    """CPU time of starts, in that of a start of Python with numpy beside each."""
    python, rows = sys.executable, []
    for _ in range(turns):
        of_numpy = started(python, "-c", "import numpy").cpu
        others = started(python, "-c", ""), typed("--help"), typed("replay", bag, *option)
        rows.append((of_numpy, *(each.cpu / of_numpy for each in others)))
    against = "import numpy"
    names = (
        ("import numpy, CPU time", "s", ""),
        ("python alone", "x", against),
        ("flea --help", "x", against),
        ("one bag, as typed", "x", against),
    )
    return middles(names, rows)


def middles(names: Sequence[tuple[str, str, str]], rows: Sequence[Sequence[float]]) -> list[Figure]:
    """The median of each column, printed, with its range."""
    figures = []
    for (name, unit, against), column in zip(names, np.transpose(rows), strict=True):
        low, middle, high = np.min(column), np.median(column), np.max(column)
        print(f"{name:48s}{middle:8.2f} {unit:12s}({low:.2f} to {high:.2f})")
        ends = {"low": float(low), "high": float(high), "against": against}
        figures.append(Figure(name, float(middle), unit, len(rows), **ends))
    return figures


def main() -> None:
    """Print times real time of both recordings, with each state observer, and as typed."""
    parser = bench_parser(__doc__)
    parser.add_argument("--bags", nargs="+", metavar="BAG", help="measure as typed on these alone")
    parser.add_argument("--calibration", default="", metavar="FILE", help="for --bags")
    parser.add_argument("--copies", type=int, default=0, metavar="N", help="of --bags, perturbed")
    parser.add_argument("--turns", type=int, default=TYPED_TURNS, metavar="N", help="for --bags")
    arguments = parser.parse_args()
    search_less()  # as the command does
    if arguments.bags:
        with tempfile.TemporaryDirectory() as folder:
            bags = [*arguments.bags, *perturbed(arguments.bags, arguments.copies, Path(folder))]
            figures = as_typed(bags, arguments.calibration, arguments.turns)
    else:
        figures = of_simulated_bags()
    write_summary("replay", figures, arguments.json)


def of_simulated_bags() -> list[Figure]:
    """All figures on recordings that are simulated here."""
    figures = []
    with tempfile.TemporaryDirectory() as folder:
        runs = {
            "nominal": recording(Path(folder), SECONDS),
            "jam at 60 s": recording(Path(folder), SECONDS, "--fault", "jam", "--at", "60"),
        }
        print(f"{'':14s}{'state observer':20s}{'x real time':>14s}{'singly':>10s}{'ratio':>8s}")
        for kind, backend in KINDS:
            what, rates = f"{kind}, {backend}", []
            for name, bag in runs.items():
                quick, slow = compared(bag, kind, backend)
                rates.append(quick)
                print(f"{name:14s}{what:20s}{quick:14.0f}{slow:10.0f}{quick / slow:8.1f}")
                figures += [
                    Figure(f"{name}, {what}", quick, "x real time", TURNS, seed="21"),
                    Figure(f"{name}, {what}", quick / slow, "x", TURNS, seed="21",
                           against="the same scan by scan"),
                ]  # fmt: skip
            share = rates[1] / rates[0]
            print(
                f"{'with an episode open for half of the time, of the quiet rate':62s}{share:6.2f}"
            )
            figures.append(
                Figure(f"jam at 60 s, {what}, of the rate without", share, "x", TURNS, seed="21",
                       against="the same without a fault")
            )  # fmt: skip
        return figures + as_typed(simulated(Path(folder)), "")


if __name__ == "__main__":
    main()
