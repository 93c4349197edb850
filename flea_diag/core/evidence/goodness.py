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

"""Whether a fault fits by itself: what it leaves is noise, or little of what a relation shows.

The most likely fault may still be a poor one. A relation contradicts it where the mean square that
it leaves is beyond what the noise of any healthy recording is (a ratio of likelihoods of variances,
against the limit of a detection), and is more than a share of what the relation shows: the model of
a large fault is off by more than noise.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flea_diag.core.evidence.fault_evidence import OnsetWeighed
from flea_diag.core.isolation.goodness_of_fit import LEFT_OF_PLANT, LEFT_OF_READING
from flea_diag.core.run_law.run_defects import CHANGED


class RelationLeft(NamedTuple):
    """A relation that a model does not fit: its number, and what is left in its healthy scatter."""

    relation: int
    scatter: float


def contradicted(
    weighed: OnsetWeighed, model: int, of_sensor: bool, limit_nats: float
) -> RelationLeft | None:
    """The relation that speaks most against a model; None if it fits."""
    left = weighed.left[:, model]
    louder = np.maximum(left / CHANGED, 1.0)
    nats = 0.5 * weighed.windows * (louder - 1.0 - np.log(louder))
    least = (LEFT_OF_READING if of_sensor else LEFT_OF_PLANT) ** 2
    against = np.where((nats > limit_nats) & (left >= least * weighed.shown), nats, 0.0)
    worst = int(against.argmax())
    return RelationLeft(worst, float(np.sqrt(left[worst]))) if against[worst] else None
