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

"""Columns of accelerometers as blocks of vibration."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from flea_diag.errors import RecordingError
from flea_diag.tools.recordings.source_checks import MOST_OUTSIDE, check_rate
from flea_diag.wire.records import VibrationBlock
from flea_diag.wire.sources.mapping import SourceMapping

BLOCK_S = 0.1
"""Longest block of ``sensors/vibration``."""
LONGEST_NS = 100_000_000
"""A longer break between two rows begins a new block."""


def vibration_blocks(
    where: str,
    mapping: SourceMapping,
    stamps_ns: npt.NDArray[np.int64],
    table: Mapping[str, npt.NDArray[np.float64]],
) -> tuple[VibrationBlock, ...]:
    """All axes in blocks of a tenth of a second.

    Raises
    ------
    RecordingError
        The rate is not that of the mapping, or readings lie outside their range.
    """
    axes = mapping.axes
    if not axes:
        return ()
    check_rate(where, mapping, axes, stamps_ns)
    samples = np.column_stack([axis.factor * table[axis.column] for axis in axes])
    for axis, read in zip(axes, samples.T, strict=True):
        outside = ~((read >= axis.minimum) & (read <= axis.maximum))
        if outside.mean() > MOST_OUTSIDE:
            odd = read[outside][0]
            raise RecordingError(
                f"{where}: {axis.channel} reads {odd:.6g} m/s^2, {outside.mean():.0%} of its "
                f"readings are outside its range of {axis.minimum:g} to {axis.maximum:g} m/s^2: "
                f"correct unit or range in {mapping.where}"
            )
    names = tuple(axis.channel for axis in axes)
    length = max(1, round(BLOCK_S * axes[0].rate_hz))
    gaps = 1 + np.flatnonzero(np.diff(stamps_ns) > LONGEST_NS)
    edges = sorted({*range(0, len(stamps_ns), length), *gaps.tolist()})
    return tuple(
        VibrationBlock.pack(
            int(stamps_ns[k]), names, stamps_ns[k:end] - stamps_ns[k], samples[k:end]
        )
        for k, end in pairwise([*edges, len(stamps_ns)])
    )
