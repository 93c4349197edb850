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

"""``noise_test.NoiseTest`` as a loop, for numba to compile: the same sums and limits as in numpy.

Logarithms of two libraries may differ in the last bit; rounded to whole millionths they do not.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from flea_diag.core.flat_state import FLAT, Flat, counts_of, numbers_of
from flea_diag.core.row_ring import place_loops

Array = npt.NDArray[np.float64]
Counts = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]
Memory = tuple[Counts, Counts, Flat]
"""The store and its end, and the tables of ``NOISE``."""
NOISE = LEVELS, SIGMA, LENGTHS, SUMS, FIRST = range(5)
"""Resolution, largest, ceiling and floor of each channel, shape (4, channels), and sigmas; lengths
of windows, sums of each, and of all samples of the first seconds."""


def noise_loops(
    recent: Array,
    own: tuple[Flags, Array, Flags],
    memory: Memory,
    found: Array,
) -> None:
    """Row after row; ``recent`` begins three rows before the first.

    ``own`` is that of ``NoiseTest.step``.
    """
    store, end, tables = memory
    levels, sigma = numbers_of(tables, LEVELS), numbers_of(tables, SIGMA)
    lengths, sums = counts_of(tables, LENGTHS)[0], counts_of(tables, SUMS)
    resolution, most, ceiling, floor = levels[0], levels[1], levels[2], levels[3]
    first = counts_of(tables, FIRST)[0]
    lacking, logs, missing = own
    channels = len(resolution)
    for i in range(len(found)):
        at = place_loops(store, end, lengths[-1])
        for c in range(channels):
            passed = lacking[c] and missing[i, c]
            if passed:
                # The window counts readings: its column moves along.
                for k in range(at, at - lengths[-1], -1):
                    store[k, c] = store[k - 1, c]
                    store[k, channels + c] = store[k - 1, channels + c]
            else:
                log = 0.0
                if lacking[c]:
                    known = not math.isnan(logs[i, c])
                    log = min(logs[i, c], most[c]) if known else 0.0
                else:
                    a, b, e, d = recent[i + 3, c], recent[i + 2, c], recent[i + 1, c], recent[i, c]
                    third = a - 3.0 * b + 3.0 * e - d
                    known = not math.isnan(third)
                    if known:
                        noise = max(abs(third) / math.sqrt(20.0), resolution[c])
                        log = min(math.log(noise), most[c])
                store[at, c], store[at, channels + c] = np.int64(np.rint(log * 1e6)), known
                first[c] += store[at, c]
                first[channels + c] += store[at, channels + c]
            found[i, c] = 0.0
            for w in range(len(lengths)):
                if not passed:
                    gone = at - lengths[w]
                    sums[w, c] += store[at, c] - store[gone, c]
                    sums[w, channels + c] += store[at, channels + c] - store[gone, channels + c]
                samples = sums[w, channels + c]
                mean = 1e-6 * sums[w, c] / max(samples, 1)
                if 2 * samples >= lengths[w] and not floor[c] <= mean <= ceiling[c]:
                    z = (max(mean - ceiling[c], 0.0) + min(mean - floor[c], 0.0)) / sigma[w, c]
                    if abs(z) > abs(found[i, c]):
                        found[i, c] = z


NOISE_LOOPS = (noise_loops, place_loops, *FLAT)
"""What ``backend.exact`` takes: the function, and what it calls."""
