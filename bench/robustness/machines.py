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

"""Random machines through all commands: no traceback, one answer, no file that nobody reads.

    .venv/bin/python bench/robustness/machines.py --count 10000     a third of a second each
    .venv/bin/python bench/robustness/machines.py --count 10000 --recorded-every 20    2 s more

A seed that fails is kept below --folder; its number alone makes it again.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "test"))

from support.machines.commands import through_all


def judged(seed: int, folder: Path, every: int) -> tuple[int, str, list[str]]:
    """Seed, how far it came, and what is wrong."""
    place = folder / str(seed)
    shutil.rmtree(place, ignore_errors=True)
    answers = through_all(seed, place, bool(every) and seed % every == 0)
    wrong = list(answers.wrong())
    if not wrong:
        shutil.rmtree(place)
    last = next((n for n, status in answers.status.items() if status), "none")
    return seed, f"refused by {last}" if last != "none" else "taken by all", wrong


def main() -> int:
    """Run the machines and say what came out; 1 where one is wrong."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1000, help="of the first")
    parser.add_argument(
        "--recorded-every",
        type=int,
        default=0,
        metavar="N",
        help="simulate, calibrate and replay each Nth, too; 0: none",
    )
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--folder", type=Path, help="where failures are kept")
    given = parser.parse_args()
    folder = given.folder or Path(tempfile.mkdtemp(prefix="machines_"))
    tally: Counter[str] = Counter()
    failed = 0
    with ProcessPoolExecutor(given.jobs) as pool:
        work = partial(judged, folder=folder, every=given.recorded_every)
        seeds = range(given.seed, given.seed + given.count)
        for seed, far, wrong in pool.map(work, seeds, chunksize=8):
            tally[far] += 1
            failed += bool(wrong)
            if (done := tally.total()) % 500 == 0:
                print(f"{done} done, {failed} wrong", file=sys.stderr, flush=True)
            for words in wrong:
                print(f"{seed}: {words}", flush=True)
    for far, count in tally.most_common():
        print(f"{count:6} {far}")
    print(f"{failed} of {given.count} wrong; those are in {folder}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
