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

"""A trace of one run for its drawing: signals, residuals, symbols, group and features."""

from __future__ import annotations

import gzip
import json
import math
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from flea_diag.errors import RecordingError
from flea_diag.fields.reader import read_as
from flea_diag.fields.values import FINITE
from flea_diag.formats import migrated, stamped
from flea_diag.tools.campaign.envelope import Envelope
from flea_diag.tools.campaign.trace_content import TraceContent
from flea_diag.wire.blocks import Block, ResidualBlock, ScanBlock, block_of
from flea_diag.wire.json_text import parse_json
from flea_diag.wire.records import (
    AmbiguityGroup,
    ChannelTable,
    FeatureRequest,
    FeatureValue,
    Record,
    Residual,
    Scan,
    Symbols,
    Truth,
)
from flea_diag.wire.regular_file import opened

SUFFIX = ".trace.json.gz"
LARGEST_BYTES = 16 << 20
"""Unpacked; usual traces have at most a tenth of this."""
MOST_VALUES = 1_000_000

BAND = 2.0
"""Standard deviations from an estimate to an edge of its band."""

Array = npt.NDArray[Any]


class RunTrace:
    """Collects the records of a run, input and output, in bounded memory."""

    def __init__(self) -> None:
        self._start_ns: int | None = None
        self._last_s = 0.0
        self._units: dict[str, str] = {}
        self._traces: dict[tuple[str, ...], Envelope] = {}
        self._symbols: list[list[Any]] = []
        self._groups: list[dict[str, Any]] = []
        self._features: list[dict[str, Any]] = []
        self._asked: dict[tuple[int, int], float] = {}
        self._truth: list[list[Any]] = []
        self._kinds: dict[type, Any] = {
            Scan: self._scan,
            ScanBlock: self._scans,
            Residual: self._residual,
            ResidualBlock: self._residuals,
            ChannelTable: self._table,
            Symbols: self._symbol,
            AmbiguityGroup: self._group,
            FeatureRequest: self._request,
            FeatureValue: self._feature,
            Truth: self._known,
        }

    def add(self, record: Record | Block) -> None:
        """Add one record; kinds that are not drawn are ignored."""
        take = self._kinds.get(type(record))
        if take is not None:
            take(record)

    def _seconds(self, stamp_ns: int) -> float:
        if self._start_ns is None:
            self._start_ns = stamp_ns
        return (stamp_ns - self._start_ns) / 1e9

    def _trace(self, names: tuple[str, ...]) -> Envelope:
        if names not in self._traces:
            self._traces[names] = Envelope(len(names))
        return self._traces[names]

    def _scan(self, scan: Scan) -> None:
        self._scans(ScanBlock.of(scan))

    def _scans(self, block: ScanBlock) -> None:
        self._last_s = max(self._last_s, self._draw(block.stamps_ns, block.channels, block.values))

    def _residual(self, residual: Residual) -> None:
        self._residuals(block_of(residual))

    def _residuals(self, block: ResidualBlock) -> None:
        """Each residual relative to its limit: it deviates beyond 1 or -1."""
        limits = np.where(block.thresholds > 0.0, block.thresholds, np.nan)
        names = tuple(f"{name}/limit" for name in block.names)
        self._draw(block.stamps_ns, names, block.z / limits)
        self._estimates(block)

    def _estimates(self, block: ResidualBlock) -> None:
        """Band of each estimate: BAND standard deviations below and above it."""
        if not block.estimated:
            return
        names = tuple(f"{name}/band" for name in block.estimated)
        reach = BAND * block.estimate_sigmas
        edges = np.concatenate((block.estimates - reach, block.estimates + reach))
        self._draw(np.tile(block.stamps_ns, 2), names, edges)

    def _draw(self, stamps_ns: Array, names: tuple[str, ...], values: Array) -> float:
        """Add samples to the trace of these names; return the time of the last one."""
        start_s = self._seconds(int(stamps_ns[0]))
        times_s = start_s + (stamps_ns - stamps_ns[0]) / 1e9
        inside = times_s >= 0.0
        if inside.any():
            self._trace(names).add_block(times_s[inside], values[inside])
        return float(times_s.max())

    def _table(self, table: ChannelTable) -> None:
        self._units.update({row.name: row.unit for row in table.channels})

    def _symbol(self, record: Symbols) -> None:
        time_s = self._seconds(record.stamp_ns)
        rows = [[s.residual, s.magnitude, s.slope] for s in record.symbols]
        self._symbols.append([time_s, rows])

    def _group(self, group: AmbiguityGroup) -> None:
        told = {
            "outcome": group.outcome.value,
            "episode": group.episode,
            "members": [
                [m.fault, None if math.isnan(m.probability) else round(m.probability, 4)]
                for m in group.members
            ],
            "dropped": {m.fault: m.reason for m in group.dropped},
            "words": group.words,
            "features": [list(group.features_computed), group.features_available],
        }
        if not self._groups or {**self._groups[-1], "at_s": None} != {**told, "at_s": None}:
            self._groups.append({"at_s": self._seconds(group.stamp_ns), **told})

    def _request(self, request: FeatureRequest) -> None:
        self._asked[request.episode, request.step] = self._seconds(request.stamp_ns)

    def _feature(self, value: FeatureValue) -> None:
        numbers = {
            "value": value.value,
            "low": value.nominal_low,
            "high": value.nominal_high,
            "cost_ms": value.cost_ms,
        }
        self._features.append(
            {
                "asked_s": self._asked.get((value.episode, value.step)),
                "name": value.feature,
                "symbol": value.symbol,
                "unit": value.unit,
                "reason": value.reason,
                **{key: x if math.isfinite(x) else None for key, x in numbers.items()},
            }
        )

    def _known(self, truth: Truth) -> None:
        start_ns = self._start_ns if self._start_ns is not None else truth.onset_ns
        self._truth.append([truth.fault, (truth.onset_ns - start_ns) / 1e9])

    def to_mapping(self) -> dict[str, Any]:
        """The trace as plain data; None where a signal has no value."""
        return {
            "duration_s": self._last_s,
            "traces": {
                name: {
                    "stretch_s": envelope.stretch_s,
                    "unit": self._units.get(name, ""),
                    **dict(zip(("low", "high"), envelope.extremes(column), strict=True)),
                }
                for names, envelope in self._traces.items()
                for column, name in enumerate(names)
            },
            "symbols": self._symbols,
            "groups": self._groups,
            "features": self._features,
            "truth": self._truth,
        }


def trace_path(detail: Path) -> Path:
    """File of a run's trace, beside its details."""
    return detail.with_suffix(SUFFIX)


def write_trace(detail: Path, trace: RunTrace) -> None:
    """Write a trace beside the run's details; equal traces give equal bytes."""
    content = stamped("run trace", trace.to_mapping())
    text = json.dumps(content, allow_nan=False, separators=(",", ":"))
    trace_path(detail).write_bytes(gzip.compress(text.encode(), mtime=0))


def read_trace(detail: Path) -> dict[str, Any] | None:
    """The trace beside a run's details; None if there is none or it cannot be read."""
    try:
        with opened(trace_path(detail), LARGEST_BYTES) as file, gzip.open(file) as stream:
            text = stream.read(LARGEST_BYTES + 1).decode("utf-8")
        content = parse_json(text, largest=LARGEST_BYTES, most_values=MOST_VALUES)
        trace = migrated("run trace", content, str(detail))
        read_as(TraceContent, trace, error=RecordingError, magnitudes=FINITE)
    except (OSError, EOFError, zlib.error, ValueError, RecordingError):
        return None
    return trace
