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

"""Healthy simulated runs through a relay that disturbs the stream: false alarms and counters.

scripts/bench lossy                              50 units per disturbance
python bench/bench_lossy.py 4 dropped            4 units, one disturbance
python bench/bench_lossy.py 4 dropped --live     through a relay node over DDS
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "test"))

from summary import bench_parser, share, write_summary
from support import lossy


def main() -> int:
    """One line for each disturbance, and one for each run that is not as it should be."""
    parser = bench_parser(__doc__)
    parser.add_argument("count", nargs="?", type=int, default=50, help="units, each a run")
    parser.add_argument("names", nargs="*", metavar="DISTURBANCE", help="default: all")
    parser.add_argument("--seed", type=int, default=5000, help="of the first unit (default 5000)")
    parser.add_argument("--live", action="store_true", help="by a relay node, over DDS")
    args = parser.parse_args()
    names = args.names or list(lossy.DISTURBANCES)
    unknown = [name for name in names if name not in lossy.DISTURBANCES]
    if unknown:
        parser.error(f"{unknown[0]!r} is no disturbance, choose of {', '.join(lossy.DISTURBANCES)}")
    wrong, count, figures = 0, args.count, []
    for name in names:
        run = live if args.live else lossy.passed
        runs = [run(name, seed) for seed in range(args.seed, args.seed + count)]
        figures.append(
            share(
                f"{name}: no fault called, counters exact",
                sum(not (run.called or run.miscounted) for run in runs),
                count,
                seed=f"{args.seed} to {args.seed + count - 1}",
            )
        )
        called = [run for run in runs if run.called]
        miscounted = [run for run in runs if run.miscounted]
        wrong += len(called) + len(miscounted)
        print(
            f"{name:16s} n = {count}: fault called in {len(called)}, "
            f"counters wrong in {len(miscounted)}",
            flush=True,
        )
        for run in called:
            print(f"    seed {run.seed}: {run.called[0]}")
            if lossy.called(lossy.diagnosed(lossy.nominal(run.seed, name == "vibration_gaps"))):
                print("        and so without the disturbance")
        for run in miscounted:
            print(f"    seed {run.seed}: {', '.join(run.miscounted)}")
    write_summary("lossy", figures, args.json)
    return min(wrong, 1)


def live(name: str, seed: int) -> lossy.Passed:
    """One run in a domain of its own."""
    from support.relay import relayed

    from flea_diag.nodes.run.domain import reserved_domain

    with reserved_domain() as domain:
        return relayed(name, seed, domain)


if __name__ == "__main__":
    sys.exit(main())
