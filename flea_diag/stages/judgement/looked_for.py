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

"""The faults that a verdict has looked for: those that would have been found in the last 10 s."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from flea_diag.core.residuals.residual_rows import ResidualSet
from flea_diag.wire.records import AmbiguityGroup, Outcome


class LookedFor:
    """What of a catalogue a verdict has looked for.

    Parameters
    ----------
    faults : all of the catalogue
    tests : of each fault, those that would show it
    known : residuals of the stand
    """

    def __init__(
        self, faults: Iterable[str], tests: Mapping[str, frozenset[str]], known: ResidualSet
    ) -> None:
        self._faults = tuple(faults)
        alone = {row.name for row in known.sensor_rows}
        self._by_sensors = frozenset(fault for fault, of_it in tests.items() if of_it & alone)

    def of(self, group: AmbiguityGroup, starved: bool) -> tuple[str, ...]:
        """Those of a verdict, in the order of the catalogue; none from a ``starved`` stream.

        At rest and outside the calibration sensors are still tested one by one, no more.
        """
        if starved or group.outcome is Outcome.MODEL_MISMATCH:
            return ()
        hidden = {fault for fault, _ in group.not_observable}
        if group.outcome is Outcome.NOT_OBSERVABLE:
            return tuple(f for f in self._faults if f in self._by_sensors and f not in hidden)
        return tuple(fault for fault in self._faults if fault not in hidden)
