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

"""Speed-up of ``flea evaluate`` by a second core: a simulated campaign on one and two workers.

Wall time is meaningful on an idle machine only. On others use the bound by CPU time: the time of
the command itself cannot be shared, that of its workers can.

    scripts/bench evaluate
"""

from __future__ import annotations

import os
import resource
import tempfile
import time
from pathlib import Path

from summary import Figure, bench_parser, write_summary

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

LEAST = 1.8
CAMPAIGN = """
schema_version: 1
name: medium
sources:
  - kind: drawn
    name: medium
    seed: 12
    duration_s: 30.0
    earliest_onset_s: 10.0
    latest_onset_s: 12.0
    rows:
      - {title: Nominal, cases: 6}
      - {title: Jam, fault: jam, low: 0.8, high: 1.2, cases: 3}
      - {title: Current Bias, fault: motor_current_bias, low: 0.6, high: 1.0, cases: 3}
"""


def evaluated(campaign: Path, folder: Path, jobs: int) -> tuple[float, float, float]:
    """Wall time of an evaluation, CPU time of the command and of its workers, s."""
    from flea_diag.tools.main import main as flea

    before, spent = resource.getrusage(resource.RUSAGE_CHILDREN), time.process_time()
    began = time.monotonic()
    flea(["evaluate", str(campaign), "-j", str(jobs), "-o", str(folder), "--quiet"])
    took, own = time.monotonic() - began, time.process_time() - spent
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return took, own, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    """Print both, and what the second worker gives."""
    arguments = bench_parser(__doc__).parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        campaign = folder / "medium.yaml"
        campaign.write_text(CAMPAIGN, encoding="utf-8")
        runs = {jobs: evaluated(campaign, folder / str(jobs), jobs) for jobs in (1, 2)}
    print(f"{'workers':8s}{'wall, s':>10s}{'command, s':>12s}{'workers, s':>12s}")
    for jobs, (took, own, shared) in runs.items():
        print(f"{jobs:<8d}{took:10.1f}{own:12.2f}{shared:12.2f}")
    (wall_1, own_1, shared_1), (wall_2, own_2, shared_2) = runs[1], runs[2]
    bound = (own_1 + shared_1) / (own_2 + shared_2 / 2.0)
    print(f"ratio: wall {wall_1 / wall_2:.2f}, bound by CPU time {bound:.2f} (at least {LEAST}); "
          f"load {os.getloadavg()[0]:.1f}")  # fmt: skip
    one = "one worker, 12 runs of 30 s"
    figures = (
        Figure("two workers, by the clock", wall_1 / wall_2, "x", against=one, seed="12"),
        Figure("two workers, by CPU time", bound, "x", against=one, seed="12"),
    )
    write_summary("evaluate", figures, arguments.json)


if __name__ == "__main__":
    main()
