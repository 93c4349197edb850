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

"""Every test on the residuals of a stream: Z-tests, mean-shift tests, tests of single sensors."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
import numpy.typing as npt

from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.conditions.envelope_watch import OperatingPlace
from flea_diag.core.detection.detection import Detector, TestResults
from flea_diag.core.detection.mean_shift_test import MeanShiftTest
from flea_diag.core.detection.one_way import OneWay
from flea_diag.core.residual_values import ResidualRows
from flea_diag.core.residuals.parameters import UNIT_PARAMETERS
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.stages.observer.warm_up import Offsets

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]


class ResidualTests:
    """Tests of one stream, with the limits of a calibration.

    ``estimates``: whether a state observer runs; without one no innovation is tested.
    """

    def __init__(
        self, relations: RelationSet, calibration: Calibration, estimates: bool, backend: str
    ) -> None:
        c, known = calibration, relations.residuals
        self._known = known
        self._sensors, self._circuit = known.sensor_columns, known.column(known.circuit)
        self._innovations = known.columns(known.innovations)
        of_sensors = known.columns((*known.twins, *known.own))
        self._of_sensors = {*range(len(known.rows))[self._sensors], *of_sensors}
        """Columns that faults of sensors alone move."""
        limits = [limit for limit in c.limits if estimates or limit.name not in known.innovations]
        thermal = c.tolerance.thermal_rate_k_per_s
        self._tolerance = c.tolerance
        apart, counts = c.tolerances(), c.counts
        self._z_tests = Detector(known, limits, apart, thermal, backend, counts=counts)
        self._mean_shift = MeanShiftTest(
            known, c.shifts, apart, backend, counts=counts,
            terms=relations.reading_terms(c.parameters), between=_between(c),
            metric=c.envelope.load_metric if c.envelope else None,
            ranges=c.envelope.ranges if c.envelope else {},
        )  # fmt: skip
        self._disabled: list[int] = []
        self._directed = frozenset(known.of_relations((known.friction,)))
        self._one_way = OneWay(c.parameters.moving_m_s)

    def step(
        self,
        residuals: ResidualRows,
        sensors: tuple[Array, Array],
        alone: Flags | None,
        place: OperatingPlace,
    ) -> TestResults:
        """Results after each of n scans.

        ``sensors``: statistics, shape (n, sensor tests), and limits of the tests of single
        sensors. ``alone``, shape (n,): where nothing corroborates the voltage, None: nowhere.
        ``place``: where the scans lie in what was calibrated.
        """
        if self._disabled:
            residuals.values[:, self._disabled] = np.nan
        near = self._scaled(self._scaled(residuals, residuals.noise), place.travel)
        growth = place.variance()
        if residuals.doubt is not None:
            growth = residuals.doubt if growth is None else growth * residuals.doubt
        leverage = place.leverage()
        shift = self._mean_shift.input(len(near), leverage, place.loads, near.moved)
        results = self._z_tests.step(near, growth, shift)
        results.way, results.directed = self._one_way.step(residuals), self._directed
        results.z[:, self._sensors], results.k[:, self._sensors] = sensors
        # The zero of a voltage that nothing corroborates is data quality, not a symptom;
        # what alternates with the motion (direction-normalised) still is one.
        if alone is not None and self._circuit >= 0:
            results.z[alone, self._circuit] = np.nan
        given = near, results, alone, leverage, place.loads, place.supplied
        self._mean_shift.step(*given, shift)
        return results

    def _scaled(self, rows: ResidualRows, factor: Array | None) -> ResidualRows:
        """The same residuals where they scatter by so much more, shape (n, residuals)."""
        if factor is None:
            return rows
        spread = rows.spread / factor[:, self._known.spreading, None]
        moved = None if rows.moved is None else rows.moved / factor
        values, signals, motion = rows.values / factor, rows.signals, rows.motion
        return ResidualRows(values, spread, signals, motion, rows.moving, moved=moved)

    def forget(self, columns: list[int]) -> None:
        """Empty the windows of these residuals."""
        self._z_tests.forget(columns)

    def restart(self, columns: list[int]) -> None:
        """These residuals have another zero from now on: no level of before counts."""
        self._z_tests.forget(columns)
        self._mean_shift.turn(opened=False)

    def disable_thermal(self) -> None:
        """Test no thermal residual until the episode is closed."""
        self._disabled = self._known.predicted_columns

    def turn(self, opened: bool, by: TestResults | None = None) -> None:
        """An episode has opened: innovations are frozen. Or closed: every test is armed again.

        ``by``: the results that opened it; None: of before this stream.
        """
        if not opened:
            self._disabled = []
        self._z_tests.forget(self._innovations if opened else range(len(self._known.rows)))
        self._mean_shift.turn(opened, by is not None and self._are_of_sensors(by))

    def thaw(self, columns: Collection[int]) -> None:
        """In an episode: go on with the levels of these residuals, and with no others."""
        self._mean_shift.thaw(columns)

    def _are_of_sensors(self, results: TestResults) -> bool:
        """Whether what deviates after the last scan is what faults of sensors alone move."""
        deviating = results.deviating()[-1].nonzero()[0].tolist()
        return bool(deviating) and self._of_sensors.issuperset(deviating)

    def adopt(self, offsets: Offsets) -> None:
        """The unit's offsets are known: move the windows along and narrow what units differ by."""
        tolerance = {name: getattr(self._tolerance, name) for name in UNIT_PARAMETERS}
        change = dict.fromkeys(UNIT_PARAMETERS, 0.0)
        for name, (by, sigma) in offsets.items():
            change[name], tolerance[name] = by, sigma
        self._mean_shift.adopt(list(change.values()))
        self._z_tests.adopt(list(change.values()), list(tolerance.values()))
        # How an innovation moves with a parameter is known in size alone.
        self._z_tests.forget(self._innovations)


class SensorTestsAlone:
    """Tests of single sensors; what the relations say is judged by another.

    A residual that has a value counts as judged.
    """

    def __init__(self, relations: RelationSet) -> None:
        self._known = relations.residuals

    def step(
        self,
        residuals: ResidualRows,
        sensors: tuple[Array, Array],
        alone: Flags | None,
        place: OperatingPlace,
    ) -> TestResults:
        """See ``ResidualTests.step``."""
        results = TestResults(len(self._known.rows), len(residuals))
        results.z[:] = np.where(np.isnan(residuals.values), np.nan, 0.0)
        columns = self._known.sensor_columns
        results.z[:, columns], results.k[:, columns] = sensors
        return results

    def forget(self, columns: list[int]) -> None:
        """There are no windows."""

    def restart(self, columns: list[int]) -> None:
        """There are no levels."""

    def disable_thermal(self) -> None:
        """No thermal residual is tested."""

    def turn(self, opened: bool, by: TestResults | None = None) -> None:
        """Nothing is armed."""

    def thaw(self, columns: Collection[int]) -> None:
        """Nothing is frozen."""

    def adopt(self, offsets: Offsets) -> None:
        """Nothing rests on offsets."""


def _between(calibration: Calibration) -> dict[str, float]:
    """Variance of a residual between recordings.

    What a relation neglects at one place and not at another is a shift for a run that goes there.
    """
    limits = (calibration.limit(shift.name) for shift in calibration.mean_shifts)
    return {row.name: max(max(w.sigma) for w in row.windows) ** 2 for row in limits if row}
