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

"""Residuals that are tested on a stand: those that its calibration has limits for."""

from __future__ import annotations

from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.residuals.residual_rows import ResidualRow, ResidualSet


def tested_names(known: ResidualSet, calibration: Calibration) -> list[str]:
    """Their names, in the order of the residuals."""
    return [row.name for row in known.rows if _is_tested(row, calibration)]


def _is_tested(row: ResidualRow, calibration: Calibration) -> bool:
    if row.gate == "sensor":
        return any(limit.has(row.name) for limit in calibration.sensors)
    return calibration.limit(row.name) is not None
