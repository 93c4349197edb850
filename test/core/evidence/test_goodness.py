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

"""What a fault leaves of the relations, held against noise and against what they show."""

from __future__ import annotations

import numpy as np
import pytest

from flea_diag.core.evidence.fault_evidence import OnsetWeighed
from flea_diag.core.evidence.goodness import contradicted

LIMIT = 10.0


def weighed(left: float, shown: float, windows: float = 50.0) -> OnsetWeighed:
    """Of one model and two relations, the first of which it fits."""
    none, one = np.zeros(1), np.zeros((1, 1))
    return OnsetWeighed(
        none, none, 0.0, none, none, one, one, np.array([[1.0], [left]]), np.array([40.0, shown]),
        np.array([windows, windows]),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("left", "shown", "windows", "of_sensor", "relation"),
    [
        (1.0, 1.0, 50.0, True, None),
        (2.5, 2.5, 50.0, True, None),
        (9.0, 9.0, 50.0, True, 1),
        (9.0, 9.0, 3.0, True, None),
        (9.0, 1000.0, 50.0, True, None),
        (60.0, 1000.0, 50.0, True, 1),
        (60.0, 1000.0, 50.0, False, None),
    ],
    ids=["noise", "a louder recording", "deviates by itself", "too short", "rest of a large error",
         "too large a rest of a reading", "what the drag of a jam may leave"],
)  # fmt: skip
def test_a_relation_speaks_against_a_fault(
    left: float, shown: float, windows: float, of_sensor: bool, relation: int | None
) -> None:
    found = contradicted(weighed(left, shown, windows), 0, of_sensor, LIMIT)
    assert (found.relation if found else None) == relation
    assert found is None or found.scatter == pytest.approx(np.sqrt(left))
