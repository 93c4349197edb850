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

"""``fd.Stream``: rows in as they come, verdicts out as they change."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from flea_diag.api.columns import START_NS, row_values
from flea_diag.api.diagnosis import PossibleFault, possible
from flea_diag.api.stand_facts import channels_of, files_of
from flea_diag.configuration.calibrations import learned
from flea_diag.configuration.component import make_pipeline
from flea_diag.errors import RecordingError
from flea_diag.wire.records import AmbiguityGroup, ChannelInfo, ChannelTable, Record, Scan

if TYPE_CHECKING:
    from flea_diag.api.calibrated import Calibrated
    from flea_diag.api.stand import StandFolder

UNKNOWN = float("inf")


class Stream:
    """The diagnosis of one stand, fed row by row.

    Parameters
    ----------
    stand
        ``fd.Stand``, the result of ``fd.calibrate``, the name of a shipped stand or a folder.
    rate_hz
        Rate at which the rows will come, in Hz; by default that of the calibration.

    Raises
    ------
    ConfigurationError
        There is no such stand or calibration.
    CalibrationError
        The calibration is for another description.

    Examples
    --------
    >>> stream = fd.Stream("flea")
    >>> for time_s, row in rows:
    ...     for verdict in stream.push(time_s, row):
    ...         print(verdict.outcome.value, verdict.words)
    """

    def __init__(
        self, stand: StandFolder | Calibrated | str | Path = "", rate_hz: float | None = None
    ) -> None:
        self._stand = files_of(stand)
        self._rate_hz = rate_hz or 1.0 / learned(self._stand).period_s
        self._pipeline = make_pipeline(self._stand, source="stream")
        self._last_s = -UNKNOWN
        self._channels: tuple[str, ...] = ()
        self.verdict: AmbiguityGroup | None = None
        """The latest verdict; None before the first."""

    @property
    def group(self) -> tuple[PossibleFault, ...]:
        """Possible faults of the latest verdict, the most probable first."""
        return possible(self.verdict) if self.verdict is not None else ()

    def push(self, time_s: float, row: Mapping[str, float]) -> tuple[AmbiguityGroup, ...]:
        """Take one row; return the verdicts that it changes, mostly none.

        Parameters
        ----------
        time_s
            Time of the row in seconds, later than that of the row before.
        row
            Channel -> value in SI (temperatures in degC), NaN for no reading.

        Raises
        ------
        RecordingError
            The time does not increase, or a channel or value is wrong.
        """
        if not self._last_s < time_s < UNKNOWN:
            raise RecordingError(
                f"time_s = {time_s}: must be later than the row before it ({self._last_s} s)"
            )
        names, values = row_values(row, self._stand)
        self._last_s, stamp_ns = time_s, START_NS + round(time_s * 1e9)
        caused: list[Record] = []
        if names != self._channels:
            self._channels = names
            caused += self._pipeline.handle(self._table(stamp_ns))
        caused += self._pipeline.handle(Scan(stamp_ns, names, tuple(values[0].tolist())))
        return self._changes(caused)

    def finish(self) -> tuple[AmbiguityGroup, ...]:
        """The rows have ended: verdicts that were still held back."""
        return self._changes(self._pipeline.finish())

    def reset(self) -> tuple[AmbiguityGroup, ...]:
        """Close the open episode and watch for the next fault."""
        return self._changes(self._pipeline.reset())

    def _table(self, stamp_ns: int) -> ChannelTable:
        units = channels_of(self._stand)
        rows = (
            ChannelInfo(name, units.get(name, ""), -UNKNOWN, UNKNOWN, self._rate_hz)
            for name in self._channels
        )
        return ChannelTable(stamp_ns, self._stand.name, tuple(rows))

    def _changes(self, caused: Iterable[Record]) -> tuple[AmbiguityGroup, ...]:
        found = []
        for record in caused:
            if isinstance(record, AmbiguityGroup):
                if self.verdict is None or record.verdict != self.verdict.verdict:
                    found.append(record)
                self.verdict = record
        return tuple(found)
