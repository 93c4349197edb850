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

"""Parameters of the observer."""

from __future__ import annotations

from dataclasses import dataclass

from flea_diag.core.likelihood.unit_start import WARM_UP_S
from flea_diag.stages.observer.state_estimate import KINDS, NONE
from flea_diag.wire.parameters import parameter


@dataclass(frozen=True)
class ObserverParameters:
    """What a user may set on the observer."""

    warm_up_s: float = parameter(
        WARM_UP_S,
        "time at the start of a stream in which the unit's own sensor offsets are learned",
        unit="s",
        minimum=0.0,
        maximum=60.0,
    )
    rearm_after_s: float = parameter(
        30.0,
        "time without any detection that closes an episode (0: only by ~/reset)",
        unit="s",
        minimum=0.0,
        maximum=3600.0,
    )
    gap_scans: int = parameter(
        10, "missing scans after which smoothing restarts", minimum=2, maximum=1000
    )
    state_observer: str = parameter(
        "particle",
        "what estimates the states for detection: particle or Kalman filter, or none (fastest)",
        choices=(*KINDS, NONE),
    )
    observer_backend: str = parameter(
        "auto", "what computes particle filter and tests", choices=("auto", "numpy", "numba")
    )
    observer_seed: int = parameter(
        1, "seed of the particle filter's random numbers", minimum=0, maximum=2**31 - 1
    )
