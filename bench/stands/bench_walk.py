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

"""The walk from a recording to the first verdict, as a user types it: four commands, timed.

python bench/stands/bench_walk.py [--json FILE]

The commands are those of the READMEs of the stands, each a process of its own; the one edited file
is edited by the test that runs the same walk (test/system/test_machine_walks.py).
"""

from __future__ import annotations

import shlex
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "bench"), str(ROOT / "test"), str(ROOT / "test" / "system")]

from summary import Figure, bench_parser, write_summary
from test_machine_walks import WALKS, commands, edit, recorded


def timed(machine: str, place: Path) -> Iterator[tuple[str, float]]:
    """Each command and how long it took, s."""
    for line in commands(machine):
        words = [
            part
            for word in shlex.split(line)[1:]
            for part in (sorted(str(p.relative_to(place)) for p in place.glob(word))
                         if "*" in word else [word])
        ]  # fmt: skip
        begun = time.perf_counter()
        program = [sys.executable, "-m", "flea_diag.tools.main", *words]
        subprocess.run(program, cwd=place, check=True, capture_output=True)
        name = " ".join(words[:2]) if words[0] == "stand" else words[0]
        yield name, time.perf_counter() - begun
        if name == "stand new":
            edit(machine, place / words[2])


def main() -> None:
    """Walk on each machine."""
    parser = bench_parser(__doc__)
    given = parser.parse_args()
    figures = []
    for machine in WALKS:
        with tempfile.TemporaryDirectory() as folder:
            place = Path(folder)
            recorded(machine, place)
            spent = list(timed(machine, place))
        for name, seconds in spent:
            figures.append(Figure(f"{machine}: flea {name}", seconds, "s"))
        figures.append(Figure(f"{machine}: all four", sum(s for _, s in spent), "s"))
    for figure in figures:
        print(f"{figure.name:32} {figure.value:7.1f} {figure.unit}")
    write_summary("bench/stands/bench_walk.py", figures, given.json)


if __name__ == "__main__":
    main()
