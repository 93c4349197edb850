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

"""The last seconds of vibration as received bytes, decoded only on request."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from struct import Struct
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from flea_diag.core.vibration.window import NotComputableError
from flea_diag.wire.records import SECOND_NS, VibrationBlock

MOST_BYTES = 128_000_000
"""Of all blocks together: 30 s of twelve axes at 80 kHz."""
OFFSET = Struct("<I")
"""First field of a point; one float32 of the same size follows for each axis."""


@dataclass(frozen=True)
class Stretch:
    """Decoded samples (n, axes) in m/s^2, the first taken at ``start_ns``."""

    start_ns: int
    rate_hz: float
    axes: tuple[str, ...]
    samples: npt.NDArray[np.float32]


class KeptBlock(NamedTuple):
    """A block with its rate and end, which are read without decoding it."""

    block: VibrationBlock
    rate_hz: float
    end_ns: int


class VibrationRing:
    """Bounded store of blocks in order of time.

    Counters: ``decoded_bytes`` (handed out by ``cut``), ``invalid`` (malformed blocks),
    ``stale`` (repeated or older than the newest), ``restarts`` (time jumped back, or other axes).
    """

    def __init__(self, history_s: float, gap_limit_s: float) -> None:
        self.history_ns = round(history_s * SECOND_NS)
        self.gap_limit_ns = round(gap_limit_s * SECOND_NS)
        self.decoded_bytes = 0
        self.invalid = 0
        self.stale = 0
        self.restarts = 0
        self._kept: deque[KeptBlock] = deque()
        self._bytes = 0
        """Of all that is kept."""

    @property
    def end_ns(self) -> int:
        """End of the newest sample; -1 without any."""
        return self._kept[-1].end_ns if self._kept else -1

    @property
    def axes(self) -> tuple[str, ...]:
        """Axes of the stored blocks."""
        return self._kept[-1].block.axes if self._kept else ()

    @property
    def rate_hz(self) -> float:
        """Sampling rate of the newest block; 0 without any."""
        return self._kept[-1].rate_hz if self._kept else 0.0

    def blocks(self, start_ns: int, end_ns: int) -> Iterator[tuple[VibrationBlock, int]]:
        """Blocks inside a window, undecoded, each with its end."""
        for kept in self._kept:
            if kept.block.stamp_ns >= start_ns and kept.end_ns <= end_ns:
                yield kept.block, kept.end_ns

    def add(self, block: VibrationBlock) -> KeptBlock | None:
        """Keep a block and drop old ones; None if it cannot be used."""
        kept = _measured(block)
        if kept is None:
            self.invalid += 1
            return None
        if self._kept:
            last = self._kept[-1].block
            if block.axes != last.axes or last.stamp_ns - block.stamp_ns > self.history_ns:
                self.restarts += 1
                self._kept.clear()
                self._bytes = 0
            elif block.stamp_ns <= last.stamp_ns:
                self.stale += 1
                return None
        self._kept.append(kept)
        self._bytes += len(block.data)
        while self._kept[0].end_ns < kept.end_ns - self.history_ns or self._bytes > MOST_BYTES:
            self._bytes -= len(self._kept.popleft().block.data)
        return kept

    def cut(self, start_ns: int, end_ns: int, columns: tuple[int, ...]) -> Stretch:
        """Decode the samples from ``start_ns`` up to ``end_ns`` of some axes.

        Raises
        ------
        NotComputableError
            The window is no longer stored or not yet complete, or has a gap or two rates.
        """
        kept = [k for k in self._kept if k.end_ns > start_ns and k.block.stamp_ns < end_ns]
        self._check(kept, start_ns, end_ns)
        parts = [_part(k, start_ns, end_ns) for k in kept]
        # One row per axis, as features need it, so that they need not copy again.
        rows = np.empty((len(columns), sum(len(points) for _, points in parts)), np.float32)
        place = 0
        for _, points in parts:
            for row, column in zip(rows, columns, strict=True):
                row[place : place + len(points)] = points[:, column]
            place += len(points)
        self.decoded_bytes += rows.nbytes
        return Stretch(
            parts[0][0],
            kept[0].rate_hz,
            tuple(kept[0].block.axes[column] for column in columns),
            rows.T,
        )

    def _check(self, kept: list[KeptBlock], start_ns: int, end_ns: int) -> None:
        """Refuse a window that the blocks do not cover without a gap."""
        if not kept:
            raise NotComputableError("no vibration was received in the window")
        limit = self.gap_limit_ns
        if kept[0].block.stamp_ns > start_ns + limit:
            raise NotComputableError(
                f"vibration begins {(kept[0].block.stamp_ns - start_ns) / 1e9:.3f} s "
                "after the window does"
            )
        for before, after in pairwise(kept):
            gap_ns = after.block.stamp_ns - before.end_ns
            if abs(gap_ns) > limit:
                raise NotComputableError(f"a gap of {gap_ns / 1e9:.3f} s lies in the window")
            if abs(after.rate_hz / kept[0].rate_hz - 1.0) > 0.01:
                raise NotComputableError(
                    f"the rate changes from {kept[0].rate_hz:.6g} to {after.rate_hz:.6g} Hz"
                )
        if kept[-1].end_ns < end_ns - limit:
            raise NotComputableError(
                f"vibration ends {(end_ns - kept[-1].end_ns) / 1e9:.3f} s before the window does"
            )


def _measured(block: VibrationBlock) -> KeptBlock | None:
    """Rate and end of a block from its first and last offset; None where it is malformed."""
    data, count, size = block.data, block.count, OFFSET.size * (1 + len(block.axes))
    if count < 2 or size == OFFSET.size or len(data) != count * size:
        return None
    (first,) = OFFSET.unpack_from(data)
    (last,) = OFFSET.unpack_from(data, (count - 1) * size)
    if last <= first:
        return None
    step_ns = (last - first) / (count - 1)
    return KeptBlock(block, SECOND_NS / step_ns, block.stamp_ns + last + round(step_ns))


def _part(kept: KeptBlock, start_ns: int, end_ns: int) -> tuple[int, npt.NDArray[np.float32]]:
    """Time of the first sample and the samples (n, all axes) of a block inside a window.

    A view into the block's bytes: nothing is copied before the columns are chosen.
    """
    offset_ns, samples = kept.block.points()
    stamp_ns = kept.block.stamp_ns
    if start_ns <= stamp_ns and kept.end_ns <= end_ns:
        return stamp_ns + int(offset_ns[0]), samples
    first = int(np.searchsorted(offset_ns, max(start_ns - stamp_ns, 0)))
    last = int(np.searchsorted(offset_ns, min(end_ns - stamp_ns, 2**32 - 1)))
    return stamp_ns + int(offset_ns[min(first, kept.block.count - 1)]), samples[first:last]
