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

"""Faults of sensors injected into healthy recordings, as an FMEA takes them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt

from flea_diag.core.faults.fault import Fault
from flea_diag.errors import RecordingError
from flea_diag.tools.fmea.catalogue_rows import sizes
from flea_diag.tools.fmea.failure import Failure
from flea_diag.tools.motion import POSITION
from flea_diag.tools.recordings import injection
from flea_diag.tools.recordings.injection import ChannelFault, onsets
from flea_diag.wire.bags.bag import read_bag
from flea_diag.wire.records import ChannelTable, Record, Scan
from flea_sim_driver.faults import MODE_UNIT, FaultRow, catalogue
from flea_sim_driver.machine.machine import Machine

Array = npt.NDArray[np.float64]
SPAN_SHARES = {"bias": 0.1, "drift": 0.01, "noise": 0.05}
"""Default size of a fault of a sensor as a share of what it reads in the recording, where no
machine states one; that of a drift a second."""
OTHER_SIZES = {"dead": 0.0, "dropout": 1.0, "scaling": 1.2}
BEGINS = 0.4
"""Share of the recording after which a fault begins, in motion."""
HARDWARE = (
    "no fault of a reading: it changes motion or vibration and cannot be injected: simulate it"
)


class HealthyBag:
    """A recording of a healthy actuator.

    Raises
    ------
    RecordingError
        It holds no scans, no channel table, or no motion.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        records = [record for _, record in read_bag(path, (ChannelTable, Scan))]
        self.scans = [record for record in records if isinstance(record, Scan)]
        tables = [record for record in records if isinstance(record, ChannelTable)]
        if not self.scans or not tables:
            raise RecordingError(f"{path}: no scans or no channel table in it")
        self.table = tables[0]

    def column(self, channel: str) -> Array:
        """Readings of a channel, shape (n,); NaN where a scan lacks it."""
        read = [s.value(channel) if channel in s.channels else np.nan for s in self.scans]
        return np.array(read, dtype=float)

    @cached_property
    def onset_s(self) -> float:
        """When a fault begins: in motion, or where no position says so after its share."""
        first = self.scans[0].stamp_ns
        times = np.array([(scan.stamp_ns - first) / 1e9 for scan in self.scans])
        possible = onsets(times, self.column(POSITION))
        wanted = BEGINS * times[-1]
        if not len(possible):
            raise RecordingError(f"{self.path}: too short, or too little motion, for an onset")
        return float(possible[np.argmin(np.abs(possible - wanted))])

    def row(self, fault: Fault) -> FaultRow:
        """A fault of a sensor with a size by what the sensor reads."""
        info, read = self.table.info(fault.channel), self.column(fault.channel)
        span = float(np.nanmax(read) - np.nanmin(read))
        default = OTHER_SIZES.get(fault.mode, SPAN_SHARES.get(fault.mode, 0.0) * span)
        unit = MODE_UNIT[fault.mode].format(unit=info.unit if info else "")
        return FaultRow(
            fault.name, fault.response.name, ("daq",), default, -np.inf, np.inf, unit,
            fault.approach, None, fault.channel, fault.mode,
        )  # fmt: skip

    def with_fault(self, made: ChannelFault) -> tuple[Record, ...]:
        """Its records with the fault, and the truth of it."""
        return injection.injected(self.table, self.scans, made, ("where", "daq"))


def injected(
    bags: Sequence[HealthyBag],
    known: Mapping[str, Fault],
    machine: Machine | None,
    shares: Sequence[float],
) -> Iterator[Failure]:
    """Faults of sensors in healthy recordings, in turn; of others, why there is nothing to run."""
    stated = {} if machine is None else catalogue(machine)
    number = 0
    for name, fault in known.items():
        bag = bags[number % len(bags)]
        where = fault.component.replace("_", " ")
        if not fault.channel or not all(np.isfinite(b.column(fault.channel)).any() for b in bags):
            why = f"not all recordings have {fault.channel}" if fault.channel else HARDWARE
            yield Failure(name, name, fault.response.name, where, remark=why)
            continue
        row = stated.get(name) or bag.row(fault)
        for size in sizes(row, shares):
            bag = bags[number % len(bags)]
            number += 1
            made = ChannelFault(fault.channel, fault.mode, size, bag.onset_s, number)
            yield Failure(
                f"{name}_{size:g}", name, fault.response.name, where, size, row.size_unit,
                recording=str(bag.path), injection=made, of_sensor=True,
            )  # fmt: skip
