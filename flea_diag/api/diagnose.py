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

"""``fd.diagnose``: a recording, a frame or arrays through the diagnosis, in this process."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flea_diag.api.columns import check_rate, recording_of
from flea_diag.api.diagnosis import Diagnosis
from flea_diag.api.opening import opened
from flea_diag.api.recording import Recording
from flea_diag.api.stand_facts import files_of
from flea_diag.configuration.component import make_pipeline
from flea_diag.configuration.files import given_file
from flea_diag.configuration.stand import Stand
from flea_diag.errors import RecordingError
from flea_diag.tools.garbage import searching_less
from flea_diag.tools.numeric_backend import numeric_backend
from flea_diag.tools.replay.replay import diagnosed, sources
from flea_diag.tools.replay.summary import BULK, summarise, without_values
from flea_diag.wire.blocks import Block, ResidualBlock, ScanBlock, block_of
from flea_diag.wire.records import AmbiguityGroup, Detection, Record, Residual, Scan

if TYPE_CHECKING:
    from flea_diag.api.calibrated import Calibrated
    from flea_diag.api.stand import StandFolder

MOST_ROWS = 200_000
"""Rows up to which residuals are kept by default."""


def diagnose(
    data: Any,
    stand: StandFolder | Calibrated | str | Path | None = None,
    *,
    calibration: str | Path = "",
    rate_hz: float | None = None,
    units: Mapping[str, str] | None = None,
    residuals: bool | None = None,
) -> Diagnosis:
    """Diagnose a recording, a data frame or arrays; same bits for the same data.

    Parameters
    ----------
    data
        What ``fd.open`` returns or takes; or rows in memory: a ``pandas.DataFrame``, an
        ``xarray.Dataset``, a structured array, or a mapping of names to arrays of shape (n,).
        Their columns are channels in SI (temperatures in degC), NaN where nothing was measured.
        Their times are the index (seconds or datetimes), or a column ``time_s`` or ``stamp_ns``.
    stand
        ``fd.Stand``, the result of ``fd.calibrate``, the name of a shipped stand or a folder;
        by default that of the recording, else the shipped FLEA.
    calibration
        File that replaces the stand's own.
    rate_hz
        Rate of the rows in Hz, where they have no times.
    units
        Unit of each column that is not stated in ``attrs["units"]``; values are not converted, a
        wrong unit is refused.
    residuals
        Whether to keep residuals, at some 2 kB a row; by default those of up to 200 000 rows.

    Raises
    ------
    RecordingError
        A column is wrong: its name, unit, type, times or values; or the file is unusable.
    ConfigurationError
        There is no such stand or calibration.
    CalibrationError
        The calibration is for another description.
    """
    with searching_less():
        run, known = _recording(data, stand, calibration, rate_hz, units)
        truths = run.truth
        said = diagnosed(run.records(sources()), make_pipeline(known))
        kept, blocks = _kept(said, residuals)
        summary = summarise(kept)
    if not summary["scans"]:
        raise RecordingError(f"{run.name}: no scan (topic sensors/slow), nothing to diagnose")
    return Diagnosis(
        run.name,
        {**summary, "backend": numeric_backend()},
        tuple(record for record in kept if isinstance(record, AmbiguityGroup)),
        tuple(record for record in kept if isinstance(record, Detection)),
        blocks,
        truths,
        next(_stamp(record) for record in kept if isinstance(record, Scan | ScanBlock)),
    )


def _recording(
    data: Any,
    stand: Any,
    calibration: str | Path,
    rate_hz: float | None,
    units: Mapping[str, str] | None,
) -> tuple[Recording, Stand]:
    """The recording and the stand that it is to be diagnosed on."""
    if isinstance(data, str | Path):
        data = opened(data, stand)
    in_memory = not isinstance(data, Recording)
    known = files_of(data.stand if stand is None and not in_memory else stand)
    known = replace(known, calibration=given_file(calibration)) if calibration else known
    if in_memory:
        name = getattr(data, "attrs", {}).get("recording", "frame")
        data = recording_of(data, known, name=str(name), rate_hz=rate_hz, units=units)
        check_rate(data.stamps_ns, known)
    return data, known


def _kept(
    records: Iterable[Record | Block], residuals: bool | None
) -> tuple[list[Record | Block], tuple[ResidualBlock, ...]]:
    """What a summary needs, and apart from it the residuals in blocks."""
    kept: list[Record | Block] = []
    found: list[Residual | ResidualBlock] = []
    left = MOST_ROWS if residuals is None else sys.maxsize if residuals else 0
    for record in records:
        if isinstance(record, Residual | ResidualBlock):
            left -= len(record) if isinstance(record, ResidualBlock) else 1
            if left >= 0:
                found.append(record)
            else:
                found.clear()
        elif not isinstance(record, BULK):
            kept.append(without_values(record))
    return kept, tuple(_blocks(found))


def _blocks(found: Iterable[Residual | ResidualBlock]) -> Iterator[ResidualBlock]:
    """Blocks as they are, single residuals of the same names as one block."""
    for names, part in groupby(found, key=_names):
        if names is None:
            yield from (block for block in part if isinstance(block, ResidualBlock))
        else:
            yield block_of(*(record for record in part if isinstance(record, Residual)))


def _names(record: Residual | ResidualBlock) -> tuple[Any, ...] | None:
    if isinstance(record, ResidualBlock):
        return None
    return record.names, record.regressor_names, record.estimated, len(record.health)


def _stamp(record: Scan | ScanBlock) -> int:
    return int(record.stamps_ns[0]) if isinstance(record, ScanBlock) else record.stamp_ns
