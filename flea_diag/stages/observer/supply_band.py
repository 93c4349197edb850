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

"""A supply within its band is healthy, whatever its level: what holds it against that is 0."""

from __future__ import annotations

from flea_diag.core.residual_values import ResidualRows
from flea_diag.core.residuals.relation_set import RelationSet


class SupplyBands:
    """Bands of the supplies of one stand, for scans of which the relations are formed."""

    def __init__(self, known: RelationSet) -> None:
        self._rows = [
            (known.signals.index(band.channel), known.residuals.column(band.residual), band)
            for band in known.residuals.bands
            if band.channel in known.signals
        ]

    def leave_out(self, residuals: ResidualRows) -> None:
        """Put 0 where the smoothed reading is within its band."""
        for signal, column, band in self._rows:
            reading = residuals.signals[:, signal]
            inside = (reading >= band.low) & (reading <= band.high)
            residuals.values[inside, column] = 0.0
