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

"""Windows of nominal recordings, as the law of healthy recordings is learned from them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from flea_diag.configuration.description import compiled_relations, effects_of
from flea_diag.core.calibration.nominal_trace import voltage_usable
from flea_diag.core.likelihood.effect_set import motion_signals
from flea_diag.core.residuals.residual_bank import ResidualBank
from flea_diag.core.run_law.run_windows import (
    RunWindows,
    along,
    answering,
    in_motion_only,
    place_of,
    speed_signal,
    window_scans,
    windows_of,
    with_neglected,
)
from flea_diag.core.scan_counts import ScanCounts
from flea_diag.stages.observer.regressor_table import RegressorTable

if TYPE_CHECKING:
    from flea_diag.core.calibration.calibration import Calibration, NominalRun
    from flea_diag.core.likelihood.effect_set import EffectSet
    from flea_diag.core.residual_values import ResidualRows
    from flea_diag.core.residuals.parameters import ActuatorParameters
    from flea_diag.core.residuals.residual_rows import ResidualSet


Array = npt.NDArray[np.float64]


class WindowItem(NamedTuple):
    """A recording, and the serial number of its unit."""

    run: NominalRun
    unit: str


def travel_of(recordings: Iterable[Array], rows: ResidualSet) -> tuple[float, ...]:
    """Lowest and highest place along the stroke; empty where none is read."""
    places = [place_of(readings, rows) for readings in recordings]
    read = np.concatenate(places) if places else np.empty(0)
    read = read[np.isfinite(read)]
    return (float(read.min()), float(read.max())) if len(read) else ()


@dataclass(frozen=True)
class WindowWork:
    """Work on one recording; relations and effects are made where it is done.

    ``relations`` are those that the law is of, ``travel`` the ends of the healthy one.
    """

    actuator: str
    faults: str
    channels: tuple[str, ...]
    parameters: ActuatorParameters
    voltage_limit_v: float
    period_s: float
    relations: tuple[str, ...]
    travel: tuple[float, ...] = ()

    @classmethod
    def of(cls, calibration: Calibration, actuator: str, faults: str) -> WindowWork:
        """For the relations that a calibration has limits of."""
        c = calibration
        known = compiled_relations(actuator, c.channels, c.parameters.encoder_m_per_rad != 0.0)
        weighed = tuple(n for n in known.residuals.weighed if c.limit(n) is not None)
        return cls(
            actuator, faults, c.channels, c.parameters, c.voltage_limit_v, c.period_s, weighed
        )

    def effects(self) -> EffectSet:
        """Effects of the catalogue on the relations that these channels close."""
        has_encoder = self.parameters.encoder_m_per_rad != 0.0
        known = compiled_relations(self.actuator, self.channels, has_encoder)
        return effects_of(self.actuator, self.faults, known, self.channels)

    def formed(self, effects: EffectSet, readings: Array, frozen: bool) -> ResidualRows:
        """Residuals of a recording, without those that need its voltage where that is bad."""
        rows, counts = effects.residuals, ScanCounts(self.period_s, effects.residuals.smoothing_s)
        bank = ResidualBank(
            self.parameters, effects.relations, period_s=self.period_s, counts=counts
        )
        found = bank.step(readings, frozen=frozen)
        if rows.voltage:
            good = voltage_usable(readings, found.values, self.voltage_limit_v, rows, counts)
            found.leave_out(~good, rows.needing(rows.voltage))
        return found

    def along(self, readings: Array, rows: ResidualSet) -> Array:
        """Places along the healthy travel, shape (n,)."""
        return along(place_of(readings, rows), self.travel)

    def windows(self, item: WindowItem) -> RunWindows:
        """Windows of a recording; predicted temperatures follow no sensor in it."""
        effects = self.effects()
        readings, rows = item.run.rows, effects.residuals
        formed = self.formed(effects, readings, frozen=True)
        values = in_motion_only(
            formed.values[:, rows.columns(self.relations)], formed.moving, rows, self.relations
        )
        table = RegressorTable(effects, self.parameters)
        where, moving = self.along(readings, rows), (motion_signals(rows)[1], speed_signal(rows))
        plain = with_neglected(table.rows(readings, formed), effects, self.period_s, where)
        signals = np.repeat(plain[:, None], len(self.relations), axis=1)
        for place, column, gain in answering(effects, self.parameters, self.relations):
            told = replace(formed, signals=formed.signals.copy())
            told.signals[:, column] -= np.nan_to_num(values[:, place]) / gain
            own = table.rows(readings, told)
            signals[:, place] = with_neglected(own, effects, self.period_s, where)
        return windows_of(
            item.run.name,
            item.unit,
            values,
            signals,
            (formed.motion[:, 1], *(plain[:, effects.names.index(n)] for n in moving)),
            window_scans(self.period_s),
        )

    def sharing(self) -> Sequence[tuple[int, int]]:
        """Pairs of relations that read a sensor in common, the later one first."""
        named = self.effects().residuals.named
        needs = [set(named[name].needs) for name in self.relations]
        count = range(len(needs))
        return [(later, k) for later in count for k in range(later) if needs[later] & needs[k]]
