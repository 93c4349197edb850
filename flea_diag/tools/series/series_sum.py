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

"""What a channel could be: one series on the grid of a recording, or a sum of two."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.tools.series.recorded_series import Series
from flea_diag.tools.series.series_words import NameWords

Array = npt.NDArray[np.float64]

ROUND = 0.01
"""Deviation up to which a measured rate is one of a round number."""


@dataclass(frozen=True, eq=False)
class SeriesSum:
    """What a channel could be: one series, or a sum of two.

    Parameters
    ----------
    terms
        Series with their signs.
    words
        What its name says.
    values
        Readings on the grid, shape (n,), as recorded; NaN between two recordings.
    because
        How its quantity is known, where the name does not say it.
    turn
        Reading at which an angle begins anew, in its unit; 0 where it does not.
    """

    terms: tuple[tuple[Series, int], ...]
    words: NameWords
    values: Array
    because: str = ""
    turn: float = 0.0

    @property
    def name(self) -> str:
        """Its places, as people name them."""
        signs = ["" if k == 0 and s > 0 else (" + " if s > 0 else " - ") for k, (_, s) in
                 enumerate(self.terms)]  # fmt: skip
        return "".join(f"{s}{each.words}" for s, (each, _) in zip(signs, self.terms, strict=True))

    @property
    def rate_hz(self) -> float:
        """Readings a second, rounded."""
        return rounded_rate(self.terms[0][0].rate_hz)


def rounded_rate(rate_hz: float) -> float:
    """A rate as people would have set it."""
    if not math.isfinite(rate_hz):
        return rate_hz
    for digits in (1, 2):
        step = 10.0 ** (math.floor(math.log10(rate_hz)) + 1 - digits)
        near = round(rate_hz / step) * step
        if abs(near - rate_hz) <= ROUND * rate_hz:
            return float(f"{near:.6g}")
    return float(f"{rate_hz:.4g}")
