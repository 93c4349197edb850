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

"""Nominal recordings in which a channel has no reading for far longer than in any other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from flea_diag.core.flag_runs import longest_run

Array = npt.NDArray[np.float64]

LONG_S = 1.0
"""A shorter gap is a loss of messages: an assumption."""
TIMES = 3.0
"""Longest gap of a recording over the longest of all others that makes it odd: an assumption."""


def missing_alone(
    runs: Sequence[Mapping[str, Array]], period_s: float
) -> tuple[tuple[int, str, float, float], ...]:
    """Numbers of such recordings: each with the channel, its gap, s, and the longest of the others.

    ``runs`` are the readings of each channel, recording by recording. A channel without any reading
    is not recorded at all.
    """
    found = []
    for channel in runs[0] if runs else ():
        gaps = np.array([longest_run(np.isnan(run[channel])) for run in runs]) * period_s
        worst = int(gaps.argmax())
        others = float(np.delete(gaps, worst).max(initial=0.0))
        if gaps[worst] > max(LONG_S, TIMES * others) and not np.isnan(runs[worst][channel]).all():
            found.append((worst, channel, float(gaps[worst]), others))
    return tuple(found)
