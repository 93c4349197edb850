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

"""Every size that one fault has in a recording: by the relations, and by its impacts."""

from __future__ import annotations

from collections.abc import Mapping

from flea_diag.core.faults.fault import Fault
from flea_diag.errors import ConfigurationError
from flea_diag.stages.isolator.parameters import Knowledge
from flea_diag.stages.sizes.impact_sizes import TAKEN, ImpactSizes
from flea_diag.stages.sizes.recording_sizes import RecordingSize, RecordingSizes
from flea_diag.wire.blocks import ResidualBlock, ScanBlock
from flea_diag.wire.records import Record, Residual


class AllSizes:
    """Takes records and residuals of one recording after the other; ``sizes`` of the last begun.

    Parameters
    ----------
    orders : ball-pass lines of the stand, events for each turn of the motor

    Raises
    ------
    ConfigurationError
        Nothing that the stand has shows how large the fault is; the message names what would.
    """

    def __init__(self, knowledge: Knowledge, fault: str, orders: Mapping[str, float]) -> None:
        row = knowledge.faults.get(fault)
        self._relations: RecordingSizes | None = None
        self._impacts: ImpactSizes | None = None
        if row is not None and row.impacts is not None and orders:
            self._impacts = ImpactSizes(row.impacts, knowledge.features, orders)
        try:
            self._relations = RecordingSizes(knowledge, fault)
        except ConfigurationError as error:
            if self._impacts is None:
                raise ConfigurationError(f"{error}{_would(row)}") from None

    def begin(self) -> None:
        """Another recording."""
        if self._relations is not None:
            self._relations.begin()
        if self._impacts is not None:
            self._impacts.begin()

    def add(self, record: Record | ScanBlock | ResidualBlock) -> None:
        """Whatever the recording and the observer have, in order; others are passed over."""
        if isinstance(record, (Residual, ResidualBlock)):
            if self._relations is not None:
                self._relations.add(record)
        elif isinstance(record, TAKEN) and self._impacts is not None:
            self._impacts.add(record)

    def sizes(self) -> tuple[RecordingSize, ...]:
        """Sizes that the recording determines."""
        by_relations = self._relations.sizes() if self._relations is not None else ()
        by_impacts = self._impacts.sizes() if self._impacts is not None else ()
        return (*by_relations, *by_impacts)

    @property
    def lacks(self) -> str:
        """Why the last recording has no impacts, where the fault has some; empty: it has."""
        return "" if self._impacts is None else self._impacts.lacks


def _would(fault: Fault | None) -> str:
    """What would show how large a fault of the catalogue is; empty where it does not say."""
    if fault is None:
        return ""
    if fault.sized_by:
        return f"; {fault.sized_by} would show how large it is"
    if fault.impacts is not None:
        return (
            f"; its impacts on {fault.impacts.accelerometer} would, with the ball screw under "
            "`kinematics` of stand.yaml"
        )
    return ""
