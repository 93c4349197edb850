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

"""Fuzzing of all readers of external input with damaged files; see ``test/support/fuzzing.py``.

scripts/fuzz 10                 10 s of CPU time per reader
scripts/fuzz 10 bag importer    these readers only
scripts/fuzz --atheris 60 bag   coverage-guided, see ``bench/robustness/coverage_fuzz.py``
"""

from __future__ import annotations

import argparse
import random
import resource
import sys
import time
import traceback
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "test"))

from support import fuzzing

SLOW_S = 2.0
"""CPU time for one input above which a reader counts as hanging."""
MOST_MB = 500


def main() -> int:
    """Run and print; exit status 1 if anything but a FleaError was raised."""
    if "--atheris" in sys.argv:
        import coverage_fuzz

        return coverage_fuzz.main()
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("seconds", nargs="?", type=float, default=10.0)
    known = {target.name: target for target in fuzzing.targets()}
    parser.add_argument("readers", nargs="*", metavar="READER", help=f"some of {', '.join(known)}")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    unknown = [name for name in given.readers if name not in known]
    if unknown:
        parser.error(f"{unknown[0]!r} is not a reader: choose of {', '.join(known)}")
    chosen = [known[name] for name in given.readers or known]
    inputs = failures = 0
    for target in chosen:
        count, found = damage(target, given.seconds, given.seed)
        inputs += count
        failures += sum(found.values())
        print(f"{target.name:22s} {count:8d} inputs, {sum(found.values())} failures", flush=True)
        for words, times in found.most_common(10):
            print(f"    {times} x {words}", flush=True)
    memory_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    print(f"{inputs} inputs, {failures} failures, at most {memory_mb:.0f} MB (limit {MOST_MB})")
    return int(failures > 0 or memory_mb > MOST_MB)


def damage(target: fuzzing.Target, seconds: float, seed: int) -> tuple[int, Counter[str]]:
    """Number of inputs tried, and counts of unexpected errors."""
    chance, found, count = random.Random(seed), Counter[str](), 0
    start_s = time.process_time()
    while (begun_s := time.process_time()) - start_s < seconds:
        content = fuzzing.damaged(chance.choice(target.seeds), chance)
        count += 1
        try:
            fuzzing.accepted(target, content)
        except Exception as error:  # any error but a FleaError is a failure
            place = traceback.extract_tb(error.__traceback__)[-1]
            words = f"{type(error).__name__}: {str(error)[:100]}"
            found[f"{words} ({Path(place.filename).name}:{place.lineno})"] += 1
        if time.process_time() - begun_s > SLOW_S:
            found[f"took more than {SLOW_S} s"] += 1
    return count, found


if __name__ == "__main__":
    sys.exit(main())
