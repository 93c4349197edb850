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

"""Readings held against their mapping before anything is written: ranges, rates and signs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from flea_diag.core.calibration.sign_check import sign_contradiction
from flea_diag.core.symbolic.converted_unit import CONVERTED
from flea_diag.errors import RecordingError
from flea_diag.tools.recordings.wrapped_angle import turn_of
from flea_diag.wire.records import Scan
from flea_diag.wire.sources.mapping import (
    AGE_READINGS,
    AxisMapping,
    ChannelMapping,
    SourceMapping,
)
from flea_diag.wire.sources.scan_grid import SLOWER

MOST_OUTSIDE = 0.01
"""Share of the readings of a channel that may lie outside its range: spikes."""
FOR_A_UNIT = 0.25
"""Share of the readings outside their range from which on another unit is proposed."""
MOST_DRIFT = 0.05
"""Deviation of a rate from the declared one."""
MOST_CLIPPED = 0.25
"""Share of the readings outside their range from which on the range is wrong."""
MOST_FASTER = 0.02
"""Step between readings, in declared steps, below which the unit of the time is wrong."""
PIECE_S = 5.0
"""Length over which a rate is measured."""
MOST_NAMED = 3
"""Channels that a message names."""
FEWEST = 10
"""Readings without which a rate is not measured."""


def clipped_to_ranges(
    where: str, mapping: SourceMapping, scans: Sequence[Scan]
) -> tuple[tuple[Scan, ...], tuple[str, ...]]:
    """Scans with every reading inside its declared range, and what was clipped, a line each.

    A fault may drive a reading beyond what was declared. A channel that lies outside for most of
    the time, or inside in another unit, is one whose mapping is wrong.

    Raises
    ------
    RecordingError
        Names the channel, a value, the range, and the unit that would fit.
    """
    values = np.array([scan.values for scan in scans])
    notes = []
    for column, row in enumerate(mapping.channels):
        read = values[:, column][np.isfinite(values[:, column])]
        if not len(read):
            raise RecordingError(
                f"{where}: {row.channel} ({row.terms[0].words}) has no usable reading; leave the "
                f"channel out of {mapping.where}, or raise its age_s ({row.age_s:g} s)"
            )
        outside = read[(read < row.minimum) | (read > row.maximum)]
        share = len(outside) / len(read)
        if share <= MOST_OUTSIDE:
            continue
        odd = outside[np.argmax(np.abs(outside))]
        words = (
            f"{where}: {row.channel} reads {odd:.6g} {row.unit}, {share:.0%} of its readings are "
            f"outside its range of {row.minimum:g} to {row.maximum:g} {row.unit}"
        )
        other = _other_unit(row, read) if share >= FOR_A_UNIT else ""
        if other or share > MOST_CLIPPED:
            raise RecordingError(f"{words}: {_remedy(row, other)} in {mapping.where}")
        notes.append(f"{words}: clipped; if it can read that, widen the range in {mapping.where}")
        values[:, column] = np.clip(values[:, column], row.minimum, row.maximum)
    if not notes:
        return tuple(scans), ()
    clipped = (
        replace(scan, values=tuple(row)) for scan, row in zip(scans, values.tolist(), strict=True)
    )
    return tuple(clipped), tuple(notes)


def check_turns(where: str, mapping: SourceMapping, scans: Sequence[Scan]) -> None:
    """Refuse an angle that begins anew after each turn and is not said to.

    Raises
    ------
    RecordingError
        Names the channel, the jump and the key to write.
    """
    values = np.array([scan.values for scan in scans])
    for column, row in enumerate(mapping.channels):
        if row.unit != "rad" or row.turn or len(row.terms) > 1:
            continue
        turn = turn_of((values[:, column] - row.offset) / row.factor)
        if turn:
            raise RecordingError(
                f"{where}: {row.channel} jumps by {turn:g} {row.written} and goes on: an "
                f"angle that begins anew after each turn; write turn: {turn:.6g} beside it in "
                f"{mapping.where}"
            )


def _other_unit(row: ChannelMapping, read: npt.NDArray[np.float64]) -> str:
    """The unit with which the readings would lie inside; "" if there is none."""
    own = CONVERTED.get(row.written, (row.unit, 1.0, 0.0))
    raw = (read - own[2]) / own[1]
    fits = {
        factor: unit
        for unit, (si, factor, offset) in CONVERTED.items()
        if si == row.unit and unit != row.written and _lies_inside(row, factor * raw + offset)
    }
    return fits[max(fits)] if fits else ""


def _remedy(row: ChannelMapping, other: str) -> str:
    if other:
        return f"its unit is {row.written}, should it be {other}? correct unit, or range,"
    return "correct unit, sign, scale or range"


def _lies_inside(row: ChannelMapping, values: npt.NDArray[np.float64]) -> bool:
    outside = (values < row.minimum) | (values > row.maximum)
    return float(np.mean(outside)) <= MOST_OUTSIDE


def check_rate(
    where: str,
    mapping: SourceMapping,
    rows: Sequence[ChannelMapping] | Sequence[AxisMapping],
    stamps_ns: npt.NDArray[np.int64],
) -> str:
    """Hold the rate of readings against the declared one; what is odd about it, or "".

    Stamps are true, so another rate is said and no error, unless it leaves nothing to use.
    Accelerometers are sampled evenly, and refused otherwise. Lost readings do not change the median
    of the intervals by which the rate is measured.

    Parameters
    ----------
    rows
        Channels of one declared rate whose readings have these stamps.

    Raises
    ------
    RecordingError
        Names the channels, the rate, where it was measured, and the declared one.
    """
    declared_hz = rows[0].rate_hz
    length = max(FEWEST, round(declared_hz * PIECE_S))
    for start in range(0, len(stamps_ns), length):
        piece = stamps_ns[start : start + length + 1]
        if len(piece) <= FEWEST:
            continue
        median_s = float(np.median(np.diff(piece))) * 1e-9
        rate_hz = 1.0 / median_s if median_s > 0.0 else np.inf
        if abs(rate_hz - declared_hz) <= MOST_DRIFT * declared_hz:
            continue
        at_s = (piece[0] - stamps_ns[0]) * 1e-9
        words = (
            f"{where}: {_names(rows)}: readings come at {rate_hz:.4g} Hz from {at_s:.4g} s on, "
            f"declared are {declared_hz:g} Hz"
        )
        of_columns = bool(mapping.axes) and not mapping.vibration_topic
        if of_columns or _is_no_use(rows[0], stamps_ns, declared_hz):
            raise RecordingError(
                f"{words} within {MOST_DRIFT:.0%}: correct rate_hz in {mapping.where}, or the "
                "clock that stamps them"
            )
        return f"{words}: {_taken(rows[0], median_s * declared_hz)}"
    return ""


def _taken(row: ChannelMapping | AxisMapping, longer: float) -> str:
    """How readings of another rate are taken; ``longer`` are their intervals than declared."""
    bridged = getattr(row, "age_s", math.inf) > AGE_READINGS / row.rate_hz
    if bridged or longer <= SLOWER:
        return "taken by their stamps"
    return "taken by their stamps, what lies between is left out: correct rate_hz, or state age_s"


def _is_no_use(
    row: ChannelMapping | AxisMapping, stamps_ns: npt.NDArray[np.int64], declared_hz: float
) -> bool:
    """Whether most readings are too far apart to be bridged, or a unit of time must be wrong."""
    median_s = float(np.median(np.diff(stamps_ns))) * 1e-9
    longest_s = getattr(row, "age_s", 0.0)
    return median_s > longest_s or median_s * declared_hz < MOST_FASTER


def _names(rows: Sequence[ChannelMapping] | Sequence[AxisMapping]) -> str:
    names = [row.channel for row in rows[:MOST_NAMED]]
    more = [f"{len(rows) - MOST_NAMED} more"] if len(rows) > MOST_NAMED else []
    return ", ".join([*names, *more])


def check_signs(where: str, mapping: SourceMapping, scans: Sequence[Scan]) -> None:
    """Refuse signs that the balance of power contradicts, whatever the motion was.

    Raises
    ------
    RecordingError
        Names the channel whose sign, turned, would mend it, the coefficient, and its limit.
    """
    units = {row.channel: row.unit for row in mapping.channels}
    values = np.array([scan.values for scan in scans])
    words = sign_contradiction(units, values, 1e-9 * mapping.period_ns)
    if words:
        raise RecordingError(f"{where}: {words} in {mapping.where}")
