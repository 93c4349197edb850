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

"""A recording, whatever it was recorded with: channels, accelerometers, truth."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from flea_diag.api.table import Table
from flea_diag.errors import RecordingError
from flea_diag.wire.blocks import ScanBlock
from flea_diag.wire.records import (
    NEVER_NS,
    ChannelInfo,
    ChannelTable,
    Record,
    Scan,
    Truth,
    VibrationBlock,
)

if TYPE_CHECKING:
    from flea_diag.configuration.stand import Stand

SENT = (ChannelTable, Truth, VibrationBlock, Scan)
"""Records of a stand and its truth: what a recording is read for."""
Records = Callable[[tuple[type, ...]], Iterator[Record | ScanBlock]]


@dataclass(frozen=True, eq=False, repr=False)
class Recording:
    """What a stand sent: its slow channels, accelerometers where it has some, and the truth.

    Made by ``fd.open`` and ``fd.simulate``; nothing is read before it is asked for.

    Parameters
    ----------
    name
        For people.
    records
        Types of records -> those records in their order, scans alone or in blocks.
    bag
        Where the recording lies as a bag of flea_diag; None for all others.
    stand
        Files of the stand that it was opened with; None: those that ``fd.diagnose`` is given.
    """

    name: str
    records: Records
    bag: Path | None = None
    stand: Stand | None = None

    @cached_property
    def _channel_table(self) -> ChannelTable:
        tables = (r for r in self.records((ChannelTable,)) if isinstance(r, ChannelTable))
        return next(tables, ChannelTable(NEVER_NS, "", ()))

    @property
    def channels(self) -> tuple[ChannelInfo, ...]:
        """Name, unit (SI), range (in that unit), rate (Hz) and serial number of each channel."""
        return self._channel_table.channels

    @cached_property
    def truth(self) -> tuple[Truth, ...]:
        """The faults that the source knows of, each with its onset in ns; empty where unknown."""
        return tuple(r for r in self.records((Truth,)) if isinstance(r, Truth))

    @property
    def stamps_ns(self) -> npt.NDArray[np.int64]:
        """Stamp of each scan in nanoseconds since 1970, shape (scans,)."""
        blocks = [_block(r) for r in self.records((Scan,)) if isinstance(r, Scan | ScanBlock)]
        return np.concatenate([np.array([], dtype=np.int64), *(b.stamps_ns for b in blocks)])

    @cached_property
    def table(self) -> Table:
        """Slow channels in SI, one row for each scan: ``time_s`` and a column for each channel.

        Shape (scans,) each; NaN where a channel was not measured.

        Raises
        ------
        RecordingError
            There is no scan in it.
        """
        blocks = [_block(r) for r in self.records((Scan,)) if isinstance(r, Scan | ScanBlock)]
        if not blocks:
            raise RecordingError(f"{self.name}: no scan (topic sensors/slow)")
        names = dict.fromkeys(name for block in blocks for name in block.channels)
        stamps = np.concatenate([block.stamps_ns for block in blocks])
        columns = {name: np.concatenate([_column(b, name) for b in blocks]) for name in names}
        rows = {row.name: row for row in self.channels if row.name in columns}
        start_ns = int(stamps[0])
        told = {"stand": self._channel_table.stand, "channels": _plain(rows)}
        return Table(
            {"time_s": (stamps - start_ns) / 1e9, **columns},
            units={name: row.unit for name, row in rows.items() if row.unit},
            attrs={"recording": self.name, "start_ns": start_ns, **told},
        )

    def frame(self) -> Any:
        """``table`` as a ``pandas.DataFrame`` with an index ``time_s`` in seconds.

        Raises
        ------
        ConfigurationError
            pandas is not installed.
        RecordingError
            There is no scan in it.
        """
        return self.table.frame()

    def dataset(self) -> Any:
        """``table`` as an ``xarray.Dataset`` along ``time_s`` in seconds, units per variable.

        Raises
        ------
        ConfigurationError
            xarray is not installed.
        RecordingError
            There is no scan in it.
        """
        return self.table.dataset()

    def save(self, folder: str | Path) -> Recording:
        """Write the recording to a new bag (rosbag2, MCAP) and return the recording of it.

        Raises
        ------
        RecordingError
            The folder exists, or cannot be written.
        """
        from flea_diag.wire.bags.bag_writer import new_bag

        place = Path(folder)
        with new_bag(place) as bag:
            bag.write_all(self.records(SENT))
        return of_bag(place, self.stand, None)

    def __repr__(self) -> str:
        """Name, length and channels in one line."""
        time_s = self.table["time_s"]
        names = ", ".join(name for name in self.table if name != "time_s")
        return f"Recording {self.name}: {len(time_s)} scans, {time_s[-1]:.2f} s: {names}"

    def _repr_html_(self) -> str:
        """Name and first rows, for a notebook."""
        from html import escape

        return f"<p><b>{escape(self.name)}</b></p>{self.table._repr_html_()}"


def of_bag(path: Path, stand: Stand | None, namespace: str | None) -> Recording:
    """The recording of a bag; nothing of it is held in memory.

    Raises
    ------
    RecordingError
        There is no bag, or no topic of flea_diag in it.
    """
    from flea_diag.wire.bags.bag import BagReader

    BagReader(path)  # refused now, not when it is used

    def read(kinds: tuple[type, ...]) -> Iterator[Record | ScanBlock]:
        return BagReader(path).blocks(kinds, namespace)

    return Recording(path.resolve().name, read, path if namespace is None else None, stand)


def kept(name: str, records: Iterator[Record | ScanBlock], stand: Stand | None = None) -> Recording:
    """A recording of records that are held in memory."""
    held = tuple(records)

    def chosen(kinds: tuple[type, ...]) -> Iterator[Record | ScanBlock]:
        wanted = (*kinds, ScanBlock) if Scan in kinds else kinds
        return (record for record in held if isinstance(record, wanted))

    return Recording(name, chosen, stand=stand)


@contextmanager
def as_bags(runs: Sequence[Recording]) -> Iterator[list[Path]]:
    """Folder of the bag of each recording; those that are none are written to temporary ones."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="flea_runs_")))
        yield [
            run.bag or run.save(folder / str(number) / _folder_name(run.name)).bag or folder
            for number, run in enumerate(runs)
        ]


def _folder_name(name: str) -> str:
    return Path(name).name or "run"


def _block(record: Scan | ScanBlock) -> ScanBlock:
    return record if isinstance(record, ScanBlock) else ScanBlock.of(record)


def _column(block: ScanBlock, name: str) -> Any:
    if name not in block.channels:
        return np.full(len(block), np.nan)
    return block.values[:, block.channels.index(name)]


def _plain(rows: dict[str, ChannelInfo]) -> dict[str, dict[str, Any]]:
    """What is known of each channel, for whoever makes a recording of the table again."""
    from dataclasses import asdict

    return {name: asdict(row) for name, row in rows.items()}
