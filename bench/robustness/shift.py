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

"""A shift of two hours with twelve faults before the page in a browser, faster than real time.

    .venv/bin/python bench/robustness/shift.py              2 h of stand time, 12 faults
    .venv/bin/python bench/robustness/shift.py --faults 3   a shorter one, ten minutes a fault

Page and diagnosis are restarted while an alarm stands, browser and stand sleep, briefly and for
long, and somebody acknowledges, undoes, shelves, comments and marks. After each fault journal,
screen, page, report and recording must have the same alarms, to the second. Exit status 1 where
they differ, a fault is not named or memory grows. Needs Chromium, like the tests of the page.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

os.environ.setdefault("PYTEST_CURRENT_TEST", Path(__file__).name)
# NiceGUI lets several pages follow each other in a process for tests alone.
sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "test"))
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from summary import Figure, bench_parser, share, write_summary
from support.browser import missing
from support.screens.shift import Found, shift_of

FLAT = {"server": 0.05, "page": 0.15}
"""Share by which mean memory may grow from the first half to the second, after the second fault."""
SETTLED = 2
ACCOUNTS = ("screen", "page", "report", "recording")


def wrong(found: Found) -> list[str]:
    """What a shift must not show."""
    words = [f"not named: {each}" for each in found.missed]
    words += [f"no fault, but {each}" for each in found.false_alarms]
    words += [f"differs: {each}" for each in found.differences]
    for what, sizes in (("server", found.server_mb), ("page", found.page_mb)):
        later = sizes[SETTLED:]
        half = len(later) // 2
        first, last = (sum(part) / max(half, 1) for part in (later[:half], later[-half:]))
        if half and last > (1.0 + FLAT[what]) * first:
            words.append(f"memory of the {what} grew from {first:.1f} to {last:.1f} MB")
    return words


def figures(found: Found) -> Iterator[Figure]:
    """What a shift showed; each look holds four accounts against the journal."""
    named, looks = len(found.named), len(found.server_mb)
    yield share("faults named", named, named + len(found.missed))
    differ = {row.split(": ")[0] for row in found.differences}
    yield share("journal against screen, page, report and recording: alike",
                len(ACCOUNTS) * looks - len(differ), len(ACCOUNTS) * looks)  # fmt: skip
    yield Figure("alarms without a fault", len(found.false_alarms), "", looks)
    for what, sizes in (("server", found.server_mb), ("page", found.page_mb)):
        later = sizes[SETTLED:]
        mean = sum(later) / max(len(later), 1)
        low, high = min(later, default=0.0), max(later, default=0.0)
        yield Figure(f"memory of the {what}", mean, "MB", len(later), low, high)


def main() -> int:
    """Run and print; the exit status."""
    parser = bench_parser(__doc__)
    parser.add_argument("--faults", type=int, default=12)
    given = parser.parse_args()
    if missing():
        print(missing(), file=sys.stderr)
        return 2
    with tempfile.TemporaryDirectory() as folder, shift_of(Path(folder), given.faults) as shift:
        found = shift.run()
    print(json.dumps(asdict(found), indent=1))
    for words in wrong(found):
        print(words, file=sys.stderr)
    write_summary("bench/robustness/shift.py", figures(found), given.json)
    return int(bool(wrong(found)))


if __name__ == "__main__":
    sys.exit(main())
