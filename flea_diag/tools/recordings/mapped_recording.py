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

"""Recordings of any make as records, by the mapping of their stand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from flea_diag.errors import RecordingError
from flea_diag.tools.recordings.source_checks import check_signs, check_turns, clipped_to_ranges
from flea_diag.wire.records import NEVER_NS, ChannelTable, Scan, Truth, VibrationBlock
from flea_diag.wire.sources.mapping import SourceMapping
from flea_diag.wire.sources.scan_grid import ScanGrid


@dataclass(frozen=True)
class MappedRecording:
    """One recording ready to be written; ``warnings`` are lines for people."""

    name: str
    mapping: SourceMapping
    made: tuple[Scan, ...]
    warnings: tuple[str, ...] = ()
    vibration: tuple[VibrationBlock, ...] = ()

    def channel_table(self) -> ChannelTable:
        """Units, ranges and rates."""
        return self.mapping.channel_table(self.made[0].stamp_ns)

    def truth(self) -> Truth | None:
        """The fault that the mapping knows of recordings of this name, from the start."""
        fault = self.mapping.fault_of(self.name)
        if fault is None:
            return None
        start_ns = self.made[0].stamp_ns
        onset_ns = NEVER_NS if fault == "nominal" else start_ns
        return Truth(start_ns, fault, onset_ns, (("run", self.name),))

    def scans(self) -> tuple[Scan, ...]:
        """Every scan, in order."""
        return self.made


def checked(
    where: str,
    name: str,
    mapping: SourceMapping,
    scans: Sequence[Scan],
    grid: ScanGrid,
    notes: Sequence[str] = (),
) -> MappedRecording:
    """A recording whose readings agree with their mapping; ``notes`` are said with it.

    Raises
    ------
    RecordingError
        It has no readings, or they contradict their mapping.
    """
    if not scans:
        raise RecordingError(f"{where}: no readings")
    check_turns(where, mapping, scans)
    kept, clipped = clipped_to_ranges(where, mapping, scans)
    check_signs(where, mapping, kept)
    counts = {key: count for key, count in grid.counts.items() if count}
    said = ", ".join(f"{count} {key}" for key, count in counts.items())
    odd = (f"{where}: readings with odd stamps: {said}",) if said else ()
    return MappedRecording(name, mapping, kept, (*notes, *clipped, *odd))
