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

"""Coverage-guided fuzzing of all readers of external input, by Atheris.

    scripts/fuzz --atheris 60             60 s per reader
    scripts/fuzz --atheris 60 bag yaml    readers whose names begin with bag or yaml

Atheris ends its process, so each reader runs in a process of its own. Trees are fuzzed as YAML.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parents[1] / "test")]
INSTRUMENTED = ["flea_diag", "flea_sim_driver", "mcap", "yaml"]
MOST_MB, MOST_S = 500, 60
"""Limits of memory (besides Python and its libraries) and wall time for one input. With tracing a
parser takes seconds for a long file on a busy machine; merely slow readers are found without
tracing, by CPU time."""
LIBRARIES_MB = 300
DONE = re.compile(r"Done (\d+) runs in (\d+) second")


def main() -> int:
    """Fuzz each reader in turn; exit status 1 if one raised anything but a FleaError."""
    parser = argparse.ArgumentParser(prog="scripts/fuzz", description=__doc__.splitlines()[0])
    parser.add_argument("--atheris", action="store_true", help="coverage-guided (this program)")
    parser.add_argument("--one", metavar="READER", help=argparse.SUPPRESS)
    parser.add_argument("seconds", type=float, help="time per reader, s")
    parser.add_argument("readers", nargs="*", metavar="READER", help="beginning of a name (all)")
    given = parser.parse_intermixed_args()
    try:
        import atheris
    except ImportError:
        print("Atheris is not installed: pip install atheris", file=sys.stderr)
        return 2
    if given.one:
        fuzz(atheris, given.one, given.seconds)
    from support import fuzzing

    names = [target.name for target in fuzzing.targets()]
    chosen = [name for name in names if name.startswith(tuple(given.readers or names))]
    if not chosen:
        parser.error(f"no reader has a name beginning so: choose of {', '.join(names)}")
    told = [apart(name, given.seconds) for name in chosen]
    print(f"{sum(count for count, _ in told)} inputs, {sum(failed for _, failed in told)} failures")
    return int(any(failed for _, failed in told))


def apart(name: str, seconds: float) -> tuple[int, bool]:
    """Fuzz one reader in a process of its own; return inputs tried, and whether one failed."""
    command = [sys.executable, __file__, "--one", name, str(seconds)]
    done = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False)
    found = DONE.search(done.stderr)
    count = int(found[1]) if found else 0
    print(f"{name:22s} {count:8d} inputs, {'none failed' if found else 'FAILED'}", flush=True)
    if not found:
        print(done.stdout[-3000:], done.stderr[-3000:], sep="\n", flush=True)
    return count, not found


def fuzz(atheris: Any, name: str, seconds: float) -> None:
    """Fuzz until the time is over or an unexpected error occurs; never returns."""
    with atheris.instrument_imports(include=INSTRUMENTED):
        from support import fuzzing
    target = next(target for target in fuzzing.targets() if target.name == name)
    target = target if isinstance(target.seeds[0], bytes) else fuzzing.as_text(target)

    def once(content: bytes) -> None:
        fuzzing.accepted(target, content)

    with tempfile.TemporaryDirectory() as folder:
        for number, seed in enumerate(target.seeds):
            Path(folder, str(number)).write_bytes(seed)
        limits = [f"-max_total_time={seconds:.0f}", f"-timeout={MOST_S}", "-verbosity=1"]
        limits += [f"-rss_limit_mb={MOST_MB + LIBRARIES_MB}", f"-artifact_prefix={folder}/"]
        atheris.Setup([sys.argv[0], *limits, folder], once)
        atheris.Fuzz()


if __name__ == "__main__":
    sys.exit(main())
