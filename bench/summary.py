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

"""What a bench measured, as one JSON: each figure with its unit, n, spread and comparison.

Every bench takes ``--json FILE`` (``bench_parser``), prints for people, and ends with
``write_summary``. Absolute times hold for one machine and its load at the time, which the summary
states; ratios within one run travel.
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from flea_diag.tools.interval import wilson
from flea_diag.tools.numeric_backend import numeric_backend
from flea_diag.tools.origin import commit, today

ROOT = Path(__file__).resolve().parents[1]
SCHEMA_VERSION = 1


@dataclass(frozen=True)
class Figure:
    """One measured value.

    ``low`` and ``high`` are a 95 % interval for a share, else the extremes of the ``n`` values
    behind it; ``seed`` is that of the runs, ``against`` says what a ratio compares with.
    """

    name: str
    value: float
    unit: str
    n: int = 1
    low: float | None = None
    high: float | None = None
    against: str = ""
    seed: str = ""


@dataclass(frozen=True)
class BenchSummary:
    """One run of a bench; ``load`` is the machine's load average, over ``cores`` cores."""

    name: str
    date: str
    commit: str
    backend: str
    load: float
    cores: int
    figures: tuple[Figure, ...]
    schema_version: int = SCHEMA_VERSION


def share(name: str, right: int, count: int, **more: str) -> Figure:
    """A share of runs in per cent, with Wilson's interval."""
    low, high = (100.0 * end for end in wilson(right, count))
    return Figure(name, 100.0 * right / max(count, 1), "%", count, low, high, **more)


def bench_parser(description: str | None) -> argparse.ArgumentParser:
    """Command line of a bench; the caller adds arguments of its own."""
    parser = argparse.ArgumentParser(
        description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures to FILE")
    return parser


def write_summary(name: str, figures: Iterable[Figure], path: Path | None) -> None:
    """Write the summary of a bench to ``path``, or nothing where none is given."""
    if path is None:
        return
    summary = BenchSummary(
        name,
        today(),
        commit(ROOT),
        numeric_backend(),
        os.getloadavg()[0],
        os.cpu_count() or 1,
        tuple(figures),
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    content = shortened(asdict(summary))
    path.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", encoding="utf-8")


def shortened(value: Any) -> Any:
    """Numbers to four significant digits: more would claim more than was measured."""
    if isinstance(value, float):
        return float(f"{value:.4g}")
    if isinstance(value, dict):
        return {key: shortened(each) for key, each in value.items()}
    return [shortened(each) for each in value] if isinstance(value, (list, tuple)) else value
