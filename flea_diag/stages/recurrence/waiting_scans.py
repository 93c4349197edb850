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

"""Residuals of a stream that wait until windows of the law are whole."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from flea_diag.core.run_law.run_windows import PLACE
from flea_diag.wire.blocks import ResidualBlock, block_of
from flea_diag.wire.records import Residual


class WaitingScans:
    """Scans that came one by one or in blocks, in their order.

    ``scans`` are those of one window, ``position`` is the signal that tells the place along the
    stroke; empty: none does.
    """

    def __init__(self, scans: int, position: str) -> None:
        self._scans, self._position = scans, position
        self._blocks: list[ResidualBlock] = []
        self._singly: list[Residual] = []
        """Those behind the blocks."""
        self._count = self._begun = 0
        """Those that wait, and those of the present window that were taken before them."""

    def __len__(self) -> int:
        return self._count

    def add(self, record: Residual) -> None:
        """One more waits."""
        self._singly.append(record)
        self._count += 1

    def extend(self, block: ResidualBlock) -> None:
        """So many more wait."""
        self._gather()
        self._blocks.append(block)
        self._count += len(block)

    def complete(self, windows: int = 1) -> bool:
        """Whether so many windows are whole with them."""
        return self._begun + self._count >= windows * self._scans

    def taken(self) -> ResidualBlock:
        """All of them, along the stroke; none waits any more."""
        self._gather()
        block, self._blocks = ResidualBlock.joined(self._blocks), []
        self._begun, self._count = (self._begun + self._count) % self._scans, 0
        return _placed_along(block, self._position)

    def _gather(self) -> None:
        """Of scans that came one by one, make a block."""
        if self._singly:
            self._blocks.append(block_of(*self._singly))
            self._singly = []


def _placed_along(block: ResidualBlock, position: str) -> ResidualBlock:
    """The same residuals with the place along the stroke; NaN where nothing reads it."""
    names = block.regressor_names
    place = np.full(len(block), math.nan)
    if position in names:
        place = block.regressors[:, names.index(position)]
    columns = block.regressors[:, :-2], place, block.regressors[:, -2:]
    names = (*names[:-2], PLACE, *names[-2:])
    return replace(block, regressors=np.column_stack(columns), regressor_names=names)
