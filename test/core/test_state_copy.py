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

"""Copies of state: independent of the original, alike in what they share."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from flea_diag.core.frozen import Frozen
from flea_diag.core.state_copy import state_copy


@dataclass(frozen=True)
class Limits(Frozen):
    """What never changes."""

    high: float


class Counts(NamedTuple):
    """What changes under names."""

    of: str
    each: np.ndarray


class Ring:
    """What changes, in all the ways that state is held."""

    def __init__(self, generator: np.random.Generator) -> None:
        self.generator = generator
        self.limits = Limits(3.0)
        self.function = np.maximum
        self.rows, self.parts = np.zeros(3), (1, [2])
        self.named, self.kinds = Counts("a", np.zeros(2)), frozenset({1, 2})
        self.seen, self.last, self.counts = {1}, deque([1, 2], maxlen=2), {"a": [0]}


class Chain:
    def __init__(self) -> None:
        self.generator = np.random.default_rng(1)
        self.ring = Ring(self.generator)
        self.ring_again = self.ring


def change(ring: Ring) -> None:
    ring.rows[0] = 1.0
    ring.parts[1].append(3)
    ring.named.each[0] = 1.0
    ring.seen.add(2)
    ring.last.append(3)
    ring.counts["a"][0] = 4


def held(ring: Ring) -> tuple:
    return ring.rows.tolist(), ring.parts, ring.seen, list(ring.last), ring.counts


def test_a_copy_stays_as_it_was_and_what_never_changes_is_shared():
    chain = Chain()
    copied = state_copy(chain)
    change(chain.ring)
    assert held(copied.ring) == ([0.0, 0.0, 0.0], (1, [2]), {1}, [1, 2], {"a": [0]})
    assert copied.ring.last.maxlen == 2
    assert copied.ring.named.of == "a"
    assert copied.ring.named.each.tolist() == [0.0, 0.0]
    assert copied.ring.kinds is chain.ring.kinds
    assert copied.ring.limits is chain.ring.limits
    assert copied.ring.function is np.maximum


def test_what_is_one_object_is_one_in_the_copy_too():
    chain = Chain()
    copied = state_copy(chain)
    assert copied.ring_again is copied.ring
    assert copied.generator is copied.ring.generator
    drawn = chain.generator.integers(1000, size=4).tolist()
    assert copied.ring.generator.integers(1000, size=4).tolist() == drawn
