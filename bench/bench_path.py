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

"""The way of a scan through the diagnosis: files of ours that it enters, and moves between them.

A move is a change of file: a call into another file, and the return from it. Standard library,
numpy and compiled loops are not followed; what they call of ours is a move from the file that
called them. The scans are those of two bags: ``quiet`` is the commonest way of the scans of
bags/nominal that cause nothing but their residual; ``group change`` is the scan of bags/jam that
narrows the group of possible faults most. ``stops`` are the files of flea_diag/stages among them,
the named stages of the work; ``--names`` lists them in order of their first visit.

    scripts/bench path
"""

from __future__ import annotations

import os
import statistics
import sys
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT)]

from summary import Figure, bench_parser, write_summary

import flea_diag
from flea_diag.configuration.component import DIAGNOSER
from flea_diag.wire.bags.bag import BagReader
from flea_diag.wire.records import AmbiguityGroup, Record, Scan

OURS = str(Path(flea_diag.__file__).parent) + os.sep
STAGES = "stages" + os.sep
BACKENDS = ("numpy", "numba") if find_spec("numba") else ("numpy",)


EARLIER = {
    ("quiet", "numpy"): (50, 220),
    ("quiet", "numba"): (51, 178),
    ("group change", "numpy"): (55, 1838),
    ("group change", "numba"): (56, 1788),
}
"""Files and moves at commit 2f1ec3b, when all modules of the core lay in one folder."""


class Way(NamedTuple):
    """Files in order of their first visit, relative to the package, and changes of file."""

    files: tuple[str, ...]
    moves: int

    @property
    def stops(self) -> tuple[str, ...]:
        """Files of the stages."""
        return tuple(name for name in self.files if name.startswith(STAGES))


def traced(work: Callable[[], Any]) -> tuple[Any, Way]:
    """What ``work`` returns, and its way through our files."""
    calls: list[str] = []
    files: dict[str, None] = {}

    def follow(frame: Any, event: str, _: Any) -> None:
        name = frame.f_code.co_filename
        if event != "call" or not name.startswith(OURS):
            return
        files[name.removeprefix(OURS)] = None
        caller = frame.f_back
        while caller is not None and not caller.f_code.co_filename.startswith(OURS):
            caller = caller.f_back
        if caller is None or caller.f_code.co_filename != name:
            calls.append(name)

    sys.setprofile(follow)
    try:
        result = work()
    finally:
        sys.setprofile(None)
    return result, Way(tuple(files), 2 * len(calls))


def ways(bag: Path, backend: str) -> Iterator[tuple[Way, tuple[Record, ...]]]:
    """Way of each scan of a bag, and the records that it caused."""
    diagnoser = DIAGNOSER.build(
        DIAGNOSER.parameters(state_observer="particle", observer_backend=backend, source="replay")
    )
    for _, record in BagReader(bag).records(diagnoser.consumes):
        if isinstance(record, Scan):
            caused, way = traced(lambda record=record: diagnoser.handle(record))
            yield way, caused
        else:
            diagnoser.handle(record)


def quiet(backend: str) -> Way:
    """The commonest way of scans that cause their residual alone."""
    found = (way for way, caused in ways(ROOT / "bags" / "nominal", backend) if len(caused) == 1)
    return statistics.mode(found)


def group_change(backend: str) -> Way:
    """The way of the scan after which the most faults are ruled out."""
    before, most, widest = 0, 0, Way((), 0)
    for way, caused in ways(ROOT / "bags" / "jam", backend):
        for group in caused:
            if isinstance(group, AmbiguityGroup):
                if before - len(group.members) > most:
                    most, widest = before - len(group.members), way
                before = len(group.members)
    return widest


def main() -> None:
    """Print the table."""
    parser = bench_parser(__doc__)
    parser.add_argument("--names", action="store_true", help="list the stops")
    arguments = parser.parse_args()
    print(f"{'scan':14s}{'backend':>9s}{'files':>7s}{'stops':>7s}{'moves':>7s}")
    figures = []
    for name, measure in (("quiet", quiet), ("group change", group_change)):
        for backend in BACKENDS:
            way = measure(backend)
            row = f"{name:14s}{backend:>9s}{len(way.files):7d}{len(way.stops):7d}{way.moves:7d}"
            print(row, *(way.stops if arguments.names else ()), sep="\n    ")
            figures += figures_of(name, backend, way)
    write_summary("path", figures, arguments.json)


def figures_of(scan: str, backend: str, way: Way) -> list[Figure]:
    """Files, stops and moves of one way, each with what it was in one folder."""
    files, moves = EARLIER[scan, backend]
    way_of = f"{scan}, {backend}"
    return [
        Figure(f"{way_of}: files", len(way.files), "files", against=f"{files} in one folder"),
        Figure(f"{way_of}: files of the stages", len(way.stops), "files"),
        Figure(f"{way_of}: moves", way.moves, "moves", against=f"{moves} in one folder"),
    ]


if __name__ == "__main__":
    main()
