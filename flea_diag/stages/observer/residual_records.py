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

"""Residual records: the residuals that a stand has limits for, with their tests."""

from __future__ import annotations

import numpy as np

from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.invariant import shaped
from flea_diag.core.residuals.residual_rows import ResidualSet
from flea_diag.stages.judgement.tested import tested_names
from flea_diag.stages.observer.residual_stream import StreamOutput
from flea_diag.wire.blocks import ResidualBlock, ScanBlock


class ResidualRecords:
    """Makes the records of one stand."""

    def __init__(
        self, known: ResidualSet, calibration: Calibration, regressor_names: tuple[str, ...]
    ) -> None:
        tested = tested_names(known, calibration)
        self._columns = np.array(known.columns(tested), dtype=int)
        self._regressor_names = regressor_names
        self._names = tuple(tested)

    def block(self, scans: ScanBlock, output: StreamOutput) -> ResidualBlock:
        """One record for each of these scans; made once."""
        if output.records is None:
            output.records = self._made(scans, output)
        return output.records

    def _made(self, scans: ScanBlock, output: StreamOutput) -> ResidualBlock:
        results = output.results
        shaped("regressors", output.regressors.shape, (len(scans), len(self._regressor_names)))
        return ResidualBlock(
            scans.stamps_ns,
            self._names,
            output.residuals.values.take(self._columns, axis=1),
            results.z.take(self._columns, axis=1),
            results.k.take(self._columns, axis=1),
            self._regressor_names,
            output.regressors,
            *output.estimate,
        )
