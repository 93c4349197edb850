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

"""What is said of one healthy run whose load cell is whole, is silent from 8 s on, or absent."""

from __future__ import annotations

import math
from functools import cache

from flea_diag.operator.state import SHOWN, OperatorState, fold
from flea_diag.wire.records import Record
from support import stands
from support.observer_scans import after, healthy

WHOLE, HALF, GONE = "whole", "half", "gone"
SILENT_FROM = {WHOLE: 2000, HALF: 800, GONE: 0}
"""Scan from which on the load cell reads nothing."""
LOST = (
    "parity_mechanical", "parity_mechanical_dn", "load_force_noise", "load_force_stuck",
    "load_force_dropout",
)  # fmt: skip
"""Tests that rest on the load cell."""


@cache
def told(load_cell: str) -> tuple[Record, ...]:
    """Scans of the run, and all that the diagnosis says to them."""
    first = SILENT_FROM[load_cell]
    scans = [
        after(scan, load_force=math.nan) if k >= first else scan for k, scan in enumerate(healthy())
    ]
    return (*scans, *stands.replay(stands.pipeline(), [stands.table(), *scans]))


@cache
def shown(load_cell: str) -> tuple[OperatorState, int]:
    """What a screen folds of it, and its clock at the end."""
    state, last_ns = OperatorState(), 0
    for record in told(load_cell):
        last_ns = max(last_ns, record.stamp_ns)
        if isinstance(record, SHOWN):
            state = fold(state, record, record.stamp_ns)
    return state, last_ns
