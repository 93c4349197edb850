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

"""Each sensor by itself, over a stream of scans of which some may be missing."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.residuals.residual_rows import ResidualSet
from flea_diag.core.sensors.position_step import SPAN
from flea_diag.core.sensors.sensor_tests import SensorTests
from flea_diag.wire.records import ChannelTable

Array = npt.NDArray[np.float64]
Stamps = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]


class SensorValidation:
    """Sensor tests of one stream; a missing scan is an empty row to them, so no step spans it."""

    def __init__(self, known: ResidualSet, calibration: Calibration, backend: str) -> None:
        c = calibration
        self._tests = SensorTests(
            c.sensors,
            known.channels,
            known.sensors,
            backend,
            period_s=c.period_s,
            counts=c.counts,
            turned=(known.position, c.parameters.encoder_m_per_rad * c.period_s),
        )
        self._period_ns = round(calibration.period_s * 1e9)
        self._places: npt.NDArray[np.int64] | None = None
        """Of the last scans among those tested, where some were missing."""
        self.k = self._tests.k
        """Limit of each test, NaN where the calibration has none."""

    @property
    def withholds(self) -> bool:
        """Whether any of the last readings is withheld."""
        return self._tests.withholds

    def take_ranges(self, table: ChannelTable) -> None:
        """Use the ranges of a channel table: a reading at the end of its range is clipped."""
        for row in table.channels:
            self._tests.bound(row.name, row.minimum, row.maximum)

    def interrupt(self) -> None:
        """There is a gap before the next scan."""
        self._tests.interrupt()

    @property
    def stuck(self) -> Mapping[str, int]:
        """Number of held readings of each channel."""
        return self._tests.stuck

    @property
    def away(self) -> Flags | None:
        """In which of the last scans the actuator had run away; None: in none."""
        return self._of_these(self._tests.away)

    @property
    def outlying(self) -> Flags | None:
        """Which of the last readings are withheld for they may be outliers; None: none."""
        return self._of_these(self._tests.outlying)

    def _of_these(self, flags: Flags | None) -> Flags | None:
        return flags if flags is None or self._places is None else flags[self._places]

    def step(self, before_ns: int, stamps_ns: Stamps, rows: Array) -> tuple[Array, Array]:
        """Usable readings, shape (n, channels), and test statistics, shape (n, sensor tests).

        Where none is withheld the usable ones are the rows, see ``withholds``.
        ``before_ns`` is the stamp of the scan before these.
        """
        self._places = None
        if len(rows) == 1 and int(stamps_ns[0]) - before_ns < 1.5 * self._period_ns:
            return self._tested(rows)
        apart = (stamps_ns - np.append(before_ns, stamps_ns[:-1])) / self._period_ns
        places = np.cumsum(np.clip(np.rint(apart), 1, 2 * SPAN).astype(np.int64)) - 1
        if places[-1] + 1 == len(rows):
            return self._tested(rows)
        whole = np.full((int(places[-1]) + 1, rows.shape[1]), np.nan)
        whole[places] = rows
        usable, z = self._tested(whole)
        self._places = places
        return usable[places], z[places]

    def _tested(self, rows: Array) -> tuple[Array, Array]:
        results = self._tests.step(rows)
        return results.usable, results.z
