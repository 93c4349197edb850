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

"""Windows that are formed when somebody asks, against those that are formed as scans come."""

from __future__ import annotations

import numpy as np
import pytest

from flea_diag.core.evidence.kept_scans import KeptScans
from flea_diag.core.evidence.stream_windows import LawScans, LawWindow, LawWindowMeans
from flea_diag.core.run_law.run_windows import FORMED, PLACE

RELATIONS = ("balance", "circuit")
MOTION = ("current", "load", "way", "speed")
SCANS, MOST = 20, 4


def means() -> LawWindowMeans:
    signals, names = ("one", *MOTION, *FORMED), ("one", *MOTION, PLACE)
    acting = np.ones((2, len(signals)), dtype=bool)
    return LawWindowMeans(RELATIONS, signals, names, MOTION, acting, (-2.0, 2.0), 0.01, SCANS)


def drawn(count: int) -> LawScans:
    draw = np.random.default_rng(1)
    table, values = draw.standard_normal((count, 6)), draw.standard_normal((count, 2))
    table[30:45, 2] = np.nan
    return LawScans(values, table, draw.random(count) < 0.5)


def same(one: LawWindow, other: LawWindow) -> None:
    for name in ("values", "signals", "read", "motion", "stands"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


@pytest.mark.parametrize("piece", [1, 7, 20, 53, 400])
def test_windows_are_the_same_whenever_they_are_asked_for(piece: int) -> None:
    """What later ones have of earlier ones, heat and speed, is kept of those passed over."""
    scans, asked = drawn(400), 330
    every = [window for _, window in means().add(scans)]
    kept = KeptScans(means(), SCANS, MOST)
    for first in range(0, asked, piece):
        kept.add(scans.part(slice(first, min(first + piece, asked))))
    for _ in range(2):  # asking changes nothing
        later, windows = kept.windows()
        assert len(windows.values) == MOST
        for k, window in enumerate(every[asked // SCANS - MOST : asked // SCANS]):
            same(windows.part(k), window)
    found = list(later.add(scans.part(slice(asked, None))))
    assert [number for number, _ in found] == [9, 29, 49, 69]
    for (_, one), other in zip(found, every[asked // SCANS :], strict=True):
        same(one, other)
