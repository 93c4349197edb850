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

"""Recordings for a calibration: nominal, in SI units, of one stand, without duplicates."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from flea_diag.errors import CalibrationError, FleaError, shown
from flea_diag.tools.bag_url import BagUrl, local
from flea_diag.tools.calibrate.shared_work import ALONE, Sharing
from flea_diag.tools.terminal import warn

if TYPE_CHECKING:
    from flea_diag.core.calibration.calibration import NominalRun
    from flea_diag.core.residuals.residual_rows import ResidualSet
    from flea_diag.wire.records import ChannelTable

NOMINAL = ("", "nominal")


@dataclass(frozen=True)
class NominalRecording:
    """Content of one nominal bag; ``sampling`` is that of the voltage."""

    run: NominalRun
    stand: str
    channels: tuple[str, ...]
    sampling: str
    period_s: float
    serial: str = ""
    """Serial number of the unit, empty where no channel states one."""


def read_nominal(
    bags: Sequence[Path | BagUrl], known: ResidualSet, sharing: Sharing = ALONE
) -> tuple[list[NominalRecording], list[str]]:
    """Usable recordings, and the reasons against the others, which are also printed at once.

    ``known`` names the channels that are read.
    """
    recordings: list[NominalRecording] = []
    refused: list[str] = []
    places = [bag.resolve() for bag in bags]
    items = [(place if sharing.cluster else bag, place in places[:number])
             for number, (bag, place) in enumerate(zip(bags, places, strict=True))]  # fmt: skip
    for found in sharing.over(partial(_read_or_refused, known=known), items, "recordings"):
        for words in found.warnings:
            warn(words)
        twin = _twin(found.recording, recordings)
        if twin:
            found = NominalRead(None, (), twin)
        if found.recording is None:
            refused.append(found.refused)
            warn(found.refused)
        else:
            recordings.append(found.recording)
    return recordings, refused


def _twin(one: NominalRecording | None, known: Sequence[NominalRecording]) -> str:
    """Words on a recording that holds what one before it holds, under another name."""
    import numpy as np

    if one is None or bool((np.isnan(one.run.rows) | (one.run.rows == one.run.rows[:1])).all()):
        return ""
    for other in known:
        kinds = [(r.stand, r.sampling, r.period_s) for r in (one, other)]
        alike = kinds[0] == kinds[1]
        if alike and np.array_equal(one.run.rows, other.run.rows, equal_nan=True):
            return (
                f"{one.run.name} holds the same readings as {other.run.name}: recorded or imported "
                "twice, counted once"
            )
    return ""


class NominalRead(NamedTuple):
    """What came of one bag: a recording, or why there is none."""

    recording: NominalRecording | None
    warnings: tuple[str, ...] = ()
    refused: str = ""


def _read_or_refused(item: tuple[Path | BagUrl, bool], known: ResidualSet) -> NominalRead:
    """Read one bag; the second part of the item says whether it was named before."""
    bag, again = item
    warnings: list[str] = []
    try:
        if again:
            raise CalibrationError(f"{bag} is given twice: list each recording once")
        with local(bag) as place:
            return NominalRead(_read(place, known, warnings), tuple(warnings))
    except FleaError as error:
        return NominalRead(None, tuple(warnings), str(error))


def read_any(bag: Path, known: ResidualSet) -> NominalRecording:
    """A recording, whatever its truth.

    Raises
    ------
    CalibrationError
        It has no channel table, no scans, or a channel in another unit.
    """
    return _read(bag, known, [], healthy=False)


def _read(
    bag: Path, known: ResidualSet, warnings: list[str], healthy: bool = True
) -> NominalRecording:
    """Rows, channels and period of one bag, which may have to be healthy."""
    import numpy as np

    from flea_diag.core.calibration.calibration import NominalRun
    from flea_diag.core.residuals.channel_units import UNITS

    table, stamps, measured, read, serial = _content(bag, known, warnings, healthy)
    if len(stamps) < 2 or table is None:
        missing = "channel table" if table is None else "scans"
        raise CalibrationError(f"{bag}: no {missing} ({len(stamps)} scans)")
    # Standard channels that the description lacks are of another actuator: refused by name.
    present = tuple(name for name in dict.fromkeys((*known.channels, *UNITS)) if name in read)
    voltage = table.info("motor_voltage")
    _check_units(bag, table, known)
    return NominalRecording(
        NominalRun(bag.name, measured),
        table.stand,
        present,
        voltage.sampling if voltage is not None else "",
        float(np.median(np.diff(stamps))) / 1e9,
        serial,
    )


def _content(
    bag: Path, known: ResidualSet, warnings: list[str], healthy: bool
) -> tuple[ChannelTable | None, list[int], Any, set[str], str]:
    """Channel table, stamps (ns), readings, shape (scans, channels), channels with values, serial.

    The serial number is empty where it is not known or changes.
    """
    import numpy as np

    from flea_diag.wire.bags.bag import BagReader
    from flea_diag.wire.blocks import ScanBlock
    from flea_diag.wire.records import ChannelTable, Scan, Truth

    rows: list[Any] = [_rows((), np.empty((0, 0)), known)]
    stamps: list[int] = []
    read: set[str] = set()
    serials: dict[str, None] = {}
    table: ChannelTable | None = None
    reader = BagReader(bag)
    for record in reader.blocks((ChannelTable, Scan, Truth)):
        if isinstance(record, ChannelTable):
            table = record
            serials[next((row.serial for row in table.channels if row.serial), "")] = None
        elif healthy and isinstance(record, Truth) and record.fault not in NOMINAL:
            raise CalibrationError(
                f"{bag}: truth is {shown(record.fault)}: calibration needs nominal recordings"
            )
        elif isinstance(record, ScanBlock | Scan):
            block = record if isinstance(record, ScanBlock) else ScanBlock.of(record)
            rows.append(_rows(block.channels, block.values, known))
            read.update(_with_values(block.channels, block.values))
            stamps += block.stamps_ns.tolist()
    warnings += (f"{bag}: {loss}" for loss in reader.losses)
    if len(serials) > 1:
        said = " to ".join(shown(serial) for serial in serials)
        warnings.append(
            f"{bag}: the serial number changes from {said}: of no known unit, so no spread of "
            "units is learned and recordings are left out one by one; record each unit by itself"
        )
    return table, stamps, np.concatenate(rows), read, next(iter(serials), "") * (len(serials) == 1)


def _with_values(channels: Sequence[str], values: Any) -> Iterator[str]:
    """Channels that any of these scans has a value of."""
    import numpy as np

    finite = np.isfinite(values).any(axis=0).tolist()
    return (name for name, has in zip(channels, finite, strict=True) if has)


def _rows(channels: Sequence[str], values: Any, known: ResidualSet) -> Any:
    """Columns of the residual bank in its order; NaN for missing channels."""
    import numpy as np

    rows = np.full((len(values), len(known.channels)), np.nan)
    for column, name in enumerate(channels):
        if name in known.index:
            rows[:, known.index[name]] = values[:, column]
    return rows


def _check_units(bag: Path, table: ChannelTable, known: ResidualSet) -> None:
    """Refuse a channel in another unit; unlike for a diagnosis, one without a unit, too."""
    from flea_diag.core.residuals.channel_units import unit_refusal

    for row in table.channels:
        words = unit_refusal(row.name, row.unit or "no unit", known.units)
        if words:
            raise CalibrationError(f"{bag}: {words}")
