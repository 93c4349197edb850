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

"""Size of the verdict and bandwidth of its topics, in every scenario and with many faults possible.

Each scenario of the package is simulated and diagnosed. ``before`` is the whole verdict repeated
once a second, as it was published before ``hypotheses`` was a topic; ``now`` is the summary, at
each change and once a second, with the hypotheses at each change.

    scripts/bench verdict
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT)]

from summary import Figure, bench_parser, write_summary

from flea_diag.configuration.calibrations import learned
from flea_diag.configuration.component import make_pipeline
from flea_diag.configuration.knowledge import knowledge
from flea_diag.configuration.stand import load_stand
from flea_diag.tools.replay.replay import diagnosed, sources
from flea_diag.wire.messages.codec import encode
from flea_diag.wire.messages.summary import summary
from flea_diag.wire.records import AmbiguityGroup, Candidate, Scan
from flea_sim_driver.scenario.library import find_scenario
from flea_sim_driver.stand import SimulatedStand

SCENARIOS = sorted(path.stem for path in (ROOT / "config" / "scenarios").glob("*.yaml"))
SYNTHETIC = 200


class Sizes(NamedTuple):
    """Largest messages in bytes, and bytes a second over the run, of one scenario."""

    whole: int
    brief: int
    hypotheses: int
    before_bytes_per_s: float
    now_bytes_per_s: float


def verdicts(name: str) -> tuple[list[AmbiguityGroup], int]:
    """Changes of the verdict of a scenario, and the stamp of its end."""
    records = (r for r in SimulatedStand(find_scenario(name)) if isinstance(r, sources()))
    groups, end_ns = [], 0
    for record in diagnosed(records, make_pipeline(load_stand())):
        if isinstance(record, AmbiguityGroup):
            groups.append(record)
        elif isinstance(record, Scan):
            end_ns = record.stamp_ns
    return groups, end_ns


def sizes(groups: list[AmbiguityGroup], end_ns: int) -> Sizes:
    """Sizes of these verdicts, each repeated once a second until the next."""
    whole = [len(encode(group)) for group in groups]
    brief = [len(encode(summary(group))) for group in groups]
    behind = [len(encode(group.hypotheses())) for group in groups]
    ends = [*(group.stamp_ns for group in groups[1:]), end_ns]
    times = [1 + int((end - group.stamp_ns) / 1e9) for group, end in zip(groups, ends, strict=True)]
    span_s = (end_ns - groups[0].stamp_ns) / 1e9
    new = [i == 0 or g.verdict != groups[i - 1].verdict for i, g in enumerate(groups)]
    before = sum(size * count for size, count in zip(whole, times, strict=True))
    now = sum(size * count for size, count in zip(brief, times, strict=True))
    now += sum(size for size, is_new in zip(behind, new, strict=True) if is_new)
    return Sizes(max(whole), max(brief), max(behind), before / span_s, now / span_s)


def crowded(names: list[str], like: AmbiguityGroup) -> AmbiguityGroup:
    """A verdict with all these faults possible, each with the longest reason of ``like``."""
    reasons = [c.reason for c in (*like.members, *like.dropped)]
    longest = max(reasons, key=len)
    members = tuple(
        Candidate(name, f"{name}+ | {name}-", 1 / len(names), longest, (), 0.123456789, 0.01, "N")
        for name in names
    )
    return replace(like, members=members, words=f"fault detected, one of: {', '.join(names)}")


def figures() -> Iterator[Figure]:
    """Print and yield what was measured."""
    all_sizes = []
    like: AmbiguityGroup | None = None
    print(
        f"{'scenario':28}{'whole':>8}{'now':>7}{'hypotheses':>12}{'before B/s':>12}{'now B/s':>9}"
    )
    for name in SCENARIOS:
        groups, end_ns = verdicts(name)
        like = max((g for g in groups if g.dropped), key=lambda g: len(g.words), default=like)
        row = sizes(groups, end_ns)
        all_sizes.append(row)
        print(
            f"{name:28}{row.whole:8}{row.brief:7}{row.hypotheses:12}"
            f"{row.before_bytes_per_s:12.0f}{row.now_bytes_per_s:9.0f}",
            flush=True,
        )
    assert like is not None
    faults = list(knowledge(load_stand(), learned(load_stand())).faults)
    many = [f"actuator_position_fault_{number:03}" for number in range(SYNTHETIC)]
    for names in (faults, many):
        size = len(encode(summary(crowded(names, like))))
        print(f"{len(names)} faults possible: {size} bytes")
        yield Figure(f"ambiguity_group, {len(names)} faults possible", size, "B")
    n = len(all_sizes)
    for title, values in (
        ("ambiguity_group", [row.brief for row in all_sizes]),
        ("whole verdict", [row.whole for row in all_sizes]),
        ("hypotheses", [row.hypotheses for row in all_sizes]),
    ):
        yield Figure(f"largest {title}", max(values), "B", n, min(values), max(values))
    for title, rates in (
        ("before", [row.before_bytes_per_s for row in all_sizes]),
        ("now", [row.now_bytes_per_s for row in all_sizes]),
    ):
        mean = sum(rates) / n
        print(f"{title}: {mean:.0f} B/s, mean of {n} scenarios")
        yield Figure(f"verdict topics, {title}", mean, "B/s", n, min(rates), max(rates))


if __name__ == "__main__":
    options = bench_parser(__doc__).parse_args()
    write_summary("verdict", figures(), options.json)
