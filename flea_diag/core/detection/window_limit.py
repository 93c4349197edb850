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

"""Limits of the tests on windowed means: what nominal recordings showed of each residual."""

from __future__ import annotations

from dataclasses import dataclass

from flea_diag.core.frozen import Frozen
from flea_diag.fields.values import Positive

SPEED_REGIONS_M_S = (0.025, 0.060)
"""Upper edges of the slow and the medium region of the mean |speed| in a window."""


@dataclass(frozen=True, slots=True)
class WindowLimit(Frozen):
    """Nominal statistics of one residual's mean over ``window`` samples, per speed region.

    ``k`` is the limit of |z|; ``centre`` and ``sigma`` are in the residual's unit.
    """

    window: int
    centre: tuple[float, ...]
    sigma: tuple[Positive, ...]
    k: Positive


@dataclass(frozen=True, slots=True)
class ResidualLimit(Frozen):
    """Limits of one residual; ``sigma`` is the scatter of single samples, per region.

    ``correlation_samples`` is the number of samples that carry as much news as one independent
    sample. ``spread`` is d r / d theta of healthy units (order of ``UNIT_PARAMETERS``) where the
    residual itself does not tell it scan by scan, and empty elsewhere.
    """

    name: str
    windows: tuple[WindowLimit, ...]
    sigma: tuple[Positive, ...]
    correlation_samples: Positive = 1.0
    spread: tuple[float, ...] = ()
