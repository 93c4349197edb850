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

"""Scans of a stand of which a channel is wired wrong."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from flea_diag.wire.records import Scan

Array = npt.NDArray[np.float64]
Scans = Sequence[Scan]
Wiring = Callable[[Scans], tuple[Scan, ...]]


def scaled(channel: str, factor: float, scans: Scans) -> tuple[Scan, ...]:
    """It reads so many times what it should; -1: its sign is turned."""
    return _changed(channel, scans, lambda read: factor * read)


def late(channel: str, by: int, scans: Scans) -> tuple[Scan, ...]:
    """It comes so many scans after the others."""
    return _changed(channel, scans, lambda read: np.append(np.repeat(read[:1], by), read[:-by]))


def cut_off(channel: str, share: float, scans: Scans) -> tuple[Scan, ...]:
    """It goes no further than this share of the largest reading."""

    def cut(read: Array) -> Array:
        most = share * np.nanmax(np.abs(read))
        return np.clip(read, -most, most)

    return _changed(channel, scans, cut)


def swapped(one: str, other: str, scans: Scans) -> tuple[Scan, ...]:
    """Two channels are exchanged."""
    names = list(scans[0].channels)
    places = {one: names.index(other), other: names.index(one)}
    order = [places.get(name, k) for k, name in enumerate(names)]
    return tuple(replace(s, values=tuple(s.values[k] for k in order)) for s in scans)


def _changed(channel: str, scans: Scans, change: Callable[[Array], Array]) -> tuple[Scan, ...]:
    column = scans[0].channels.index(channel)
    values = np.array([scan.values for scan in scans])
    values[:, column] = change(values[:, column])
    rows = zip(scans, values.tolist(), strict=True)
    return tuple(replace(scan, values=tuple(row)) for scan, row in rows)
