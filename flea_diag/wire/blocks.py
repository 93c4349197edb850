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

"""Blocks of consecutive records of one type as columns: same content, a fraction of the cost.

A block has no topic and stays within a process: a replay passes blocks from stage to stage where
the live graph passes single records.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

import numpy as np
import numpy.typing as npt

from flea_diag.wire.records import Record, Residual, Scan

Array = npt.NDArray[np.float64]
Stamps = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class ScanBlock:
    """n scans with the same channels: ``stamps_ns`` has shape (n,), ``values`` (n, channels)."""

    stamps_ns: Stamps
    channels: tuple[str, ...]
    values: Array

    def __len__(self) -> int:
        return len(self.stamps_ns)

    @staticmethod
    def of(*scans: Scan) -> ScanBlock:
        """Block of one or more scans, all with the channels of the first."""
        stamps_ns, values = [scan.stamp_ns for scan in scans], [scan.values for scan in scans]
        return ScanBlock(np.array(stamps_ns), scans[0].channels, np.array(values, dtype=float))

    def part(self, which: slice) -> ScanBlock:
        """Some of these scans."""
        if which.indices(len(self)) == (0, len(self), 1):
            return self
        return ScanBlock(self.stamps_ns[which], self.channels, self.values[which])

    @staticmethod
    def joined(blocks: Sequence[ScanBlock]) -> Iterator[ScanBlock]:
        """Blocks that follow each other, those of the same channels as one."""
        for channels, some in groupby(blocks, key=lambda block: block.channels):
            parts = list(some)
            stamps_ns = np.concatenate([part.stamps_ns for part in parts])
            yield ScanBlock(stamps_ns, channels, np.concatenate([part.values for part in parts]))

    def records(self) -> Iterator[Scan]:
        """The scans one by one."""
        for stamp_ns, values in zip(self.stamps_ns.tolist(), self.values.tolist(), strict=True):
            yield Scan(stamp_ns, self.channels, tuple(values))


@dataclass(frozen=True, slots=True, eq=False)
class ResidualBlock:
    """n residual records: columns of shape (n, names), regressors (n, regressor_names)."""

    stamps_ns: Stamps
    names: tuple[str, ...]
    values: Array
    z: Array
    thresholds: Array
    regressor_names: tuple[str, ...]
    regressors: Array
    estimated: tuple[str, ...]
    estimates: Array
    estimate_sigmas: Array
    health: Array

    def __len__(self) -> int:
        return len(self.stamps_ns)

    def part(self, which: slice) -> ResidualBlock:
        """Some of these records."""
        if which.indices(len(self)) == (0, len(self), 1):
            return self
        return ResidualBlock(
            self.stamps_ns[which], self.names, self.values[which], self.z[which],
            self.thresholds[which], self.regressor_names, self.regressors[which], self.estimated,
            self.estimates[which], self.estimate_sigmas[which], self.health[which],
        )  # fmt: skip

    @staticmethod
    def joined(blocks: Sequence[ResidualBlock]) -> ResidualBlock:
        """Blocks of the same names that follow each other, as one."""
        if len(blocks) == 1:
            return blocks[0]
        every = zip(*([getattr(b, name) for name in b.__slots__] for b in blocks), strict=True)
        made: list[Any] = [c[0] if isinstance(c[0], tuple) else np.concatenate(c) for c in every]
        return ResidualBlock(*made)

    def records(self) -> Iterator[Residual]:
        """The records one by one."""
        rows = zip(
            self.stamps_ns.tolist(),
            self.values.tolist(),
            self.z.tolist(),
            self.thresholds.tolist(),
            self.regressors.tolist(),
            self.estimates.tolist(),
            self.estimate_sigmas.tolist(),
            self.health.tolist(),
            strict=True,
        )
        for stamp_ns, values, z, thresholds, regressors, estimates, sigmas, health in rows:
            yield Residual(
                stamp_ns,
                self.names,
                tuple(values),
                tuple(z),
                tuple(thresholds),
                self.regressor_names,
                tuple(regressors),
                self.estimated,
                tuple(estimates),
                tuple(sigmas),
                tuple(health),
            )


def block_of(*records: Residual) -> ResidualBlock:
    """Block of one or more records, all with the names of the first."""
    first = records[0]
    return ResidualBlock(
        np.array([record.stamp_ns for record in records]),
        first.names,
        np.array([record.values for record in records], dtype=float),
        np.array([record.z for record in records], dtype=float),
        np.array([record.thresholds for record in records], dtype=float),
        first.regressor_names,
        np.array([record.regressors for record in records]),
        first.estimated,
        np.array([record.estimates for record in records]),
        np.array([record.estimate_sigmas for record in records]),
        np.array([record.health for record in records]),
    )


Block = ScanBlock | ResidualBlock


def singly(records: Iterable[Record | Block]) -> Iterator[Record]:
    """Records one by one, as topics have them."""
    for record in records:
        if isinstance(record, Block):
            yield from record.records()
        else:
            yield record
