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

"""Severity ladders: the share of right answers against the size of the fault, row by row."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

from flea_diag.tools.campaign.run_result import RunResult
from flea_diag.tools.interval import half_point, increasing
from flea_diag.tools.score.score import once, share

BINS = 5
"""Steps into which drawn sizes are grouped; each size of a ladder is a step."""
LADDER_SIZES = 12
"""A row with more different sizes than this was drawn."""


def severity(result: RunResult) -> float | None:
    """Severity of a fault: the magnitude of its size, for a scaling its distance from one."""
    if result.size is None:
        return None
    scaling = result.truth.endswith("_scaling")
    return round(abs(result.size - 1.0) if scaling else abs(result.size), 9)


def ladder(results: Sequence[RunResult]) -> dict[str, Any] | None:
    """Steps of one row with shares and intervals, and the size at which 50 % are right.

    None if the row has fewer than two sizes.
    """
    pairs = [(severity(r), r) for r in once(results) if not r.failure]
    sized = sorted(((s, r) for s, r in pairs if s is not None), key=lambda pair: pair[0])
    if len({size for size, _ in sized}) < 2:
        return None
    steps = [_step(part) for part in _parts(sized)]
    shares = [step["right"] / step["count"] for step in steps]
    rising = increasing(shares, [float(step["count"]) for step in steps])
    sizes = [step["size"] for step in steps]
    return {
        "unit": sized[0][1].size_unit,
        "steps": steps,
        "half_at": half_point(sizes, rising),
        "half": _where(rising),
    }


def _where(rising: Sequence[float]) -> str:
    """Where the size lies at which half of the runs are right."""
    if rising[0] >= 0.5:
        return "below the smallest size"
    return "between two sizes" if rising[-1] >= 0.5 else "above the largest size"


def _parts(sized: Sequence[tuple[float, RunResult]]) -> list[list[tuple[float, RunResult]]]:
    sizes = sorted({size for size, _ in sized})
    if len(sizes) <= LADDER_SIZES:
        return [[pair for pair in sized if pair[0] == size] for size in sizes]
    count = len(sized)
    edges = [round(k * count / BINS) for k in range(BINS + 1)]
    return [list(sized[a:b]) for a, b in pairwise(edges) if b > a]


def _step(part: Sequence[tuple[float, RunResult]]) -> dict[str, Any]:
    sizes = [size for size, _ in part]
    return {
        "size": sum(sizes) / len(sizes),
        "smallest": sizes[0],
        "largest": sizes[-1],
        **share(sum(result.right for _, result in part), len(part)),
    }
