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

"""Samples of accelerometers, as any message holds them, become blocks of vibration.

A message holds one sample of each axis (Imu), an array of each (Float32MultiArray, a drive's own),
or points (PointCloud2). Its stamp is that of its first sample; a point may state a time of its own.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from flea_diag.errors import WireError, shown
from flea_diag.wire.records import VibrationBlock
from flea_diag.wire.sources.mapping import AxisMapping
from flea_diag.wire.topics import POINT_CLOUD

Array = npt.NDArray[np.float64]
Stamps = npt.NDArray[np.int64]

BLOCK_NS = 50_000_000
"""Span from which on samples go out as a block: half of the longest that a block should be."""
GAP_NS = 100_000_000
"""A longer break, or a step back, begins a new block."""
MOST_SAMPLES = 1_000_000
"""Samples of one message."""
TIME = "t"
"""Field of a point that holds its time in ns after the stamp, as ours do."""
KINDS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
"""Datatype of a PointField -> that of numpy."""


class VibrationStream:
    """Makes blocks of the messages of one topic; ``axes`` are at least one."""

    def __init__(self, axes: Sequence[AxisMapping]) -> None:
        self._axes = tuple(axes)
        self._names = tuple(axis.channel for axis in axes)
        self._factors = np.array([axis.factor for axis in axes])
        self._period_ns = 1e9 / axes[0].rate_hz
        self._read = _points if axes[0].message == POINT_CLOUD else _arrays
        self._kept: list[tuple[Stamps, Array]] = []

    def push(self, stamp_ns: int, message: Any) -> Iterator[VibrationBlock]:
        """Take the samples of a message; the block that is complete with them, if any.

        Raises
        ------
        WireError
            A field is missing or holds no samples, or the axes have different numbers of them.
        """
        samples, offsets_ns = self._read(self._axes, message)
        if not len(samples):
            return
        if offsets_ns is None:
            offsets_ns = np.rint(np.arange(len(samples)) * self._period_ns).astype(np.int64)
        stamps_ns = stamp_ns + offsets_ns
        if self._kept and not 0 < stamps_ns[0] - self._kept[-1][0][-1] <= GAP_NS:
            yield from self.finish()
        self._kept.append((stamps_ns, samples * self._factors))
        if stamps_ns[-1] - self._kept[0][0][0] + self._period_ns >= BLOCK_NS:
            yield from self.finish()

    def finish(self) -> Iterator[VibrationBlock]:
        """What has come so far, as a block."""
        if not self._kept:
            return
        stamps_ns = np.concatenate([stamps for stamps, _ in self._kept])
        samples = np.concatenate([rows for _, rows in self._kept])
        self._kept.clear()
        first_ns = int(stamps_ns[0])
        yield VibrationBlock.pack(first_ns, self._names, stamps_ns - first_ns, samples)


def _arrays(axes: Sequence[AxisMapping], message: Any) -> tuple[Array, Stamps | None]:
    """Samples of fields, shape (n, axes); they are a period apart."""
    columns = []
    for axis in axes:
        value = None if axis.path is None else axis.path.value(message)
        try:
            column = np.atleast_1d(np.asarray(value, dtype=np.float64))
        except (TypeError, ValueError):
            column = np.empty((0, 0))
        if column.ndim != 1 or value is None or len(column) > MOST_SAMPLES:
            raise WireError(f"{axis.column} holds no samples of {axis.channel}")
        columns.append(column)
    counts = {len(column) for column in columns}
    if len(counts) > 1:
        raise WireError(f"the axes have {min(counts)} to {max(counts)} samples, must be as many")
    return np.column_stack(columns), None


def _points(axes: Sequence[AxisMapping], message: Any) -> tuple[Array, Stamps | None]:
    """Samples of the points of a PointCloud2, and their times where points have one."""
    kinds = {field.name: (KINDS.get(field.datatype, ""), field.offset) for field in message.fields}
    order, step = ">" if message.is_bigendian else "<", int(message.point_step)
    count = int(message.width) * int(message.height)
    data = bytes(message.data)
    wanted = [axis.column for axis in axes] + ([TIME] if TIME in kinds else [])
    for name in wanted:
        kind, offset = kinds.get(name, ("", 0))
        if not kind or offset + np.dtype(kind).itemsize > step:
            raise WireError(f"points have no field {shown(name)}, they have {', '.join(kinds)}")
    if count > MOST_SAMPLES or len(data) < count * step:
        raise WireError(f"{count} points of {step} bytes, but {len(data)} bytes of data")
    layout = np.dtype(
        {
            "names": wanted,
            "formats": [order + kinds[name][0] for name in wanted],
            "offsets": [kinds[name][1] for name in wanted],
            "itemsize": step,
        }
    )
    points = np.frombuffer(data, dtype=layout, count=count)
    samples = np.column_stack([points[axis.column].astype(np.float64) for axis in axes])
    times = points[TIME].astype(np.int64) if TIME in kinds else None
    return samples, times
