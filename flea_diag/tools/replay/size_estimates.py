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

"""Sizes of faults in recordings: by the last verdict of each episode, or by the whole of each."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flea_diag.errors import RecordingError

if TYPE_CHECKING:
    from flea_diag.configuration.stand import Stand
    from flea_diag.core.likelihood.fit import SizeError
    from flea_diag.stages.sizes.all_sizes import AllSizes
    from flea_diag.wire.records import AmbiguityGroup, ChannelTable

OF_ACTUATOR = ("motor_current", "motor_voltage", "motor_speed", "actuator_position")
"""Channels with the serial number of the test actuator; the first one given counts."""
UNKNOWN = "unknown"
MEASURED = "MEASURED"
"""In the place of an outcome: by the whole recording, whatever was concluded from it."""


@dataclass(frozen=True)
class Estimate:
    """Size of one fault by the last verdict of one episode, or by a whole recording.

    ``outcome`` says whether the fault was isolated or is one of several possible ones.
    ``size_sigma_own`` is the part of the error that other recordings of the unit do not share, NaN
    where it is not known; ``from_unit`` the others, as in ``SizeError``.
    """

    serial: str
    fault: str
    stamp_ns: int
    size: float
    size_sigma: float
    unit: str
    outcome: str
    probability: float
    bag: str
    episode: int
    size_sigma_own: float = math.nan
    quantity: str = ""
    calibration_sha256: str = ""
    limit: float = math.inf
    from_unit: tuple[float, ...] = ()
    load_n: float = math.nan

    @property
    def error(self) -> SizeError:
        """Its error; all of it is of this recording where nothing says how it splits."""
        from flea_diag.core.likelihood.fit import SizeError

        own = self.size_sigma if math.isnan(self.size_sigma_own) else self.size_sigma_own
        if self.from_unit:
            return SizeError(own, self.from_unit)
        return SizeError(own, (math.sqrt(max(self.size_sigma**2 - own**2, 0.0)),))

    def row(self) -> dict[str, Any]:
        """What is written of it."""
        return {name: getattr(self, name) for name in WRITTEN}


UNWRITTEN = ("from_unit", "limit", "load_n")
WRITTEN = tuple(f.name for f in fields(Estimate) if f.name not in UNWRITTEN)


def estimates(bag: Path, stand: Stand | None = None) -> list[Estimate]:
    """Sizes at the end of the episodes of a bag.

    Raises
    ------
    RecordingError
        There is no flea_diag bag.
    """
    from flea_diag.tools.replay.replay import diagnosis
    from flea_diag.wire.records import NEVER_NS, AmbiguityGroup, ChannelTable, Truth

    mounted = owner = ""
    last: dict[int, tuple[AmbiguityGroup, str]] = {}
    # The truth is read for the serial number only: no stage consumes it.
    for record in diagnosis(bag, stand, (ChannelTable, Truth, AmbiguityGroup)):
        if isinstance(record, ChannelTable):
            mounted = serial_of(record)
        elif isinstance(record, Truth):
            owner = dict(record.details).get("serial", "")
        elif isinstance(record, AmbiguityGroup) and record.detected_stamp_ns != NEVER_NS:
            last[record.detected_stamp_ns] = record, owner or mounted or UNKNOWN
    return [entry for group, serial in last.values() for entry in _of_group(group, serial, bag)]


def measured(bag: Path, stand: Stand, sizes: AllSizes, fault: str) -> list[Estimate]:
    """Sizes of one fault by the whole of a bag, detected or not; none without enough motion.

    Raises
    ------
    RecordingError
        There is no flea_diag bag, or two units were recorded in it.
    """
    from flea_diag.configuration.calibrations import calibration_sha256, learned
    from flea_diag.configuration.component import make_observer
    from flea_diag.tools.replay.replay import diagnosed, sources
    from flea_diag.wire.bags.bag import BagReader
    from flea_diag.wire.blocks import ScanBlock
    from flea_diag.wire.records import ChannelTable, Scan, Truth

    serials: list[str] = []
    stamp_ns = -1
    sizes.begin()
    given = BagReader(bag).blocks((*sources(), Truth))
    for record in diagnosed(given, make_observer(stand)):
        if isinstance(record, (ScanBlock, Scan)) and stamp_ns < 0:
            stamp_ns = int(
                record.stamps_ns[0] if isinstance(record, ScanBlock) else record.stamp_ns
            )
        elif isinstance(record, ChannelTable):
            serials.append(serial_of(record))
        elif isinstance(record, Truth):
            serials.append(dict(record.details).get("serial", ""))
        sizes.add(record)
    known = [serial for serial in dict.fromkeys(serials) if serial]
    if len(known) > 1:
        raise RecordingError(
            f"{bag}: two units in one recording ({', '.join(known)}), and a trend is of one: cut "
            "it where the unit is exchanged"
        )
    by = calibration_sha256(learned(stand))
    return [
        Estimate(
            known[0] if known else UNKNOWN,
            fault,
            stamp_ns,
            row.size,
            row.error.total,
            row.of.unit,
            MEASURED,
            math.nan,
            str(bag),
            0,
            row.error.own,
            row.of.name,
            by,
            row.of.limit,
            row.error.from_unit,
            row.load_n,
        )
        for row in sizes.sizes()
    ]


def serial_of(table: ChannelTable) -> str:
    """Serial number of the test actuator; empty if the table has none."""
    rows = map(table.info, OF_ACTUATOR)
    return next((row.serial for row in rows if row is not None and row.serial), "")


def _of_group(group: AmbiguityGroup, serial: str, bag: Path) -> Iterator[Estimate]:
    for member in group.members:
        # A size without standard error, or at a bound (error 0), is not an estimate.
        if math.isfinite(member.size) and member.size_sigma > 0.0:
            yield Estimate(
                serial,
                member.fault,
                group.stamp_ns,
                member.size,
                member.size_sigma,
                member.size_unit,
                group.outcome.value,
                member.probability,
                str(bag),
                group.episode,
                member.size_sigma_own,
                calibration_sha256=group.calibration_sha256,
            )
