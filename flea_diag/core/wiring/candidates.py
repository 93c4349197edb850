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

"""Which wrong wirings of one stand come into question."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from itertools import combinations

import numpy as np
import numpy.typing as npt

from flea_diag.core.residuals.residual_rows import SPEED, ResidualSet
from flea_diag.core.wiring.wiring_fault import (
    CLIPPED,
    FACTOR,
    FACTORS,
    LATE,
    SWAPPED,
    TURNED,
    WiringFault,
    at_ends,
)

Array = npt.NDArray[np.float64]

LONGEST_S = 0.3
"""Largest lag that is looked for."""
CUT_OFF = 0.05
"""Share of readings at their ends from which on a command may be cut off."""
TEMPERATURE = "degC"
"""Unit of what changes too slowly to tell a wiring in seconds."""


def channels_of(known: ResidualSet, residual: str) -> tuple[str, ...]:
    """Channels that a residual reads, any that tells the speed included."""
    needs = known.named[residual].needs
    return tuple(
        name
        for name, unit in known.units.items()
        if name in needs or (SPEED in needs and name in known.motion)
        if unit != TEMPERATURE
    )


def wiring_faults(
    known: ResidualSet, rows: Array, suspects: Collection[str]
) -> Iterator[WiringFault]:
    """Wrong wirings of a suspect, lags apart, that readings of shape (n, channels) may have."""
    told = {mode.channel for mode in known.modes}
    columns = {n: k for n, k in known.index.items() if k not in told}
    changes = [name for name, column in columns.items() if _changes(rows[:, column])]
    for name in changes:
        if name not in suspects:
            continue
        yield WiringFault(TURNED, name)
        for factor in FACTORS:
            yield WiringFault(FACTOR, name, factor=factor)
        is_command = name not in known.noise
        if is_command and np.mean(at_ends(rows[:, known.index[name]])) >= CUT_OFF:
            yield WiringFault(CLIPPED, name)
    for one, other in combinations(changes, 2):
        if known.units[one] == known.units[other] and {one, other} & set(suspects):
            yield WiringFault(SWAPPED, one, other=other)


def lags(channel: str, period_s: float) -> list[WiringFault]:
    """The channel late by 1, 2, ... scans, up to ``LONGEST_S``."""
    return [WiringFault(LATE, channel, scans=k + 1) for k in range(round(LONGEST_S / period_s))]


def _changes(values: Array) -> bool:
    """Whether a channel reads more than one value."""
    read = values[np.isfinite(values)]
    return len(read) > 0 and bool(read.min() < read.max())
