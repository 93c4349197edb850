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

"""When a fault is there and when not, moment by moment: two hidden states, the likeliest sequence.

Windows of the law are longer than many a contact is open or closed, and what comes twice within one
is counted once. So once a fault is known with its size, the windows are looked at anew in moments,

    log p(e | there) / p(e | not) = F'e - F'F / 2,

with ``F`` what it adds and ``e`` what the relations show, in standard deviations of a moment. Where
the motion does not show it, both are as likely, and the state of before goes on. That it changes is
as rare as such faults are; that a moment is as no model says, about as rare.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.core.frozen import Frozen

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Places = npt.NDArray[np.int64]

MOMENTS = 10
"""Of a window: 20 ms each, the shortest contact that two scans show."""
TURNS_HZ = 1.0
"""How often a fault that comes and goes does so, about."""
ODD = 0.02
"""Share of moments that neither state explains."""


@dataclass(frozen=True, eq=False)
class Presence(Frozen):
    """Whether a fault is there, and whether it would show, each of shape (n,)."""

    there: Flags
    shows: Flags

    @property
    def comings(self) -> Places:
        """Moments with which it came."""
        return np.flatnonzero(self.there & ~np.append(False, self.there[:-1]))


def presence(errors: Array, effect: Array, moment_s: float) -> Presence:
    """Of a fault that adds ``effect`` to ``errors`` while it is there, (n, relations).

    Both in standard deviations of a moment, 0 without a value. Before the first it is not there.
    """
    bound, rare = -math.log(ODD), -math.log(TURNS_HZ * moment_s)
    half = 0.5 * np.square(effect).sum(axis=1)
    odds = np.clip((effect * errors).sum(axis=1) - half, -bound, bound)
    return Presence(_likeliest(odds, rare), half >= bound)


def _likeliest(odds: Array, rare: float) -> Flags:
    """The sequence of states of most evidence (Viterbi 1967), of log odds and costs of a turn."""
    gone, there, turned = 0.0, -rare, []
    for each in odds.tolist():
        went, came = there - rare > gone, gone - rare > there
        gone, there = (there - rare if went else gone), (gone - rare if came else there) + each
        turned.append((went, came))
    state, states = there > gone, []
    for turns in reversed(turned):
        states.append(state)
        state ^= turns[state]
    return np.array(states[::-1], dtype=bool)
