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

"""Sizes from which faults show, as a table."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

from flea_diag.core.run_law.run_law import VisibleSize


def size_lines(visible: Iterable[VisibleSize]) -> Iterator[str]:
    """A table of sizes, in the units of the catalogue."""
    yield "fault                                      from onset  from before  named      by limits"
    for row in visible:
        label = f"{row.fault}, {row.size}" if not row.fault.endswith(row.size) else row.fault
        unit = "" if row.unit == "1" else f" {row.unit}"
        sizes = (_size(row, value) for value in (row.onset, row.before, row.named, row.limits))
        columns = "  ".join(f"{size:9s}" for size in sizes)
        alike = f"  not told from {', '.join(row.alike)}" if row.alike else ""
        yield f"{label:42s} {columns}{unit}{alike}"


def _size(row: VisibleSize, size: float) -> str:
    """A size, or that it is beyond what the catalogue holds."""
    if not math.isfinite(size):
        return "no size"
    return f"{size:.3g}" if size <= row.largest else f">{row.largest:.3g}"
