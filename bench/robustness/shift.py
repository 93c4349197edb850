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

import argparse
import json
import os
import sys
import tempfile
from dataclasses import asdict
from pathlib import Path

os.environ.setdefault("PYTEST_CURRENT_TEST", Path(__file__).name)
# NiceGUI lets several pages follow each other in a process for tests alone.
sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "test"))

from support.browser import missing
from support.screens.shift import Found, shift_of

FLAT = {"server": 0.05, "page": 0.15}
"""Share by which mean memory may grow from the first half to the second, after the second fault."""
SETTLED = 2


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


def main() -> int:
    """Run and print; the exit status."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
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
    return int(bool(wrong(found)))


if __name__ == "__main__":
    sys.exit(main())
