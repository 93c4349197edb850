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

"""What holds when: a brake, for which the motion waits, and the magnet of the coupling."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from flea_sim_driver.scenario.settings import Brake, Switch

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

SLOWS_S = 1.0
"""Time in which the motion comes to rest before the brake engages, and from its release on."""
GRIPS_S = 0.06
"""Time between the command of the brake and its grip, or its release."""


def engaged(brake: Brake, time_s: Array, late_s: float = 0.0) -> Flags:
    """Whether the brake is engaged, shape (n,); ``late_s`` after its command."""
    since = _since(brake, time_s - late_s)
    return np.asarray((brake.for_s > 0.0) & (since >= 0.0) & (since < brake.for_s))


def motion_time(brake: Brake, time_s: Array) -> Array:
    """The time of the motion, which stands still while the brake is engaged, shape (n,)."""
    if brake.for_s <= 0.0:
        return time_s
    return np.asarray(time_s - _waited(brake, time_s) + _waited(brake, np.zeros(1))[0])


MAGNET_RISES = 12.0
"""Time constants after which the pull is taken for the whole one."""


def magnet_holds_n(switch: Switch, time_s: Array) -> Array:
    """Pull of the magnet in N, shape (n,); infinite while it is not the coupling's limit.

    Its current rises by 1 - exp(-t R / L), and its pull with the square of the current.
    """
    since = time_s - switch.at_s
    if switch.at_s < 0.0 or switch.magnet_s == 0.0:
        return np.full_like(time_s, np.inf)
    rises = since / switch.magnet_s
    pull = switch.magnet_n * np.square(-np.expm1(-np.maximum(rises, 0.0)))
    return np.where((since >= 0.0) & (rises < MAGNET_RISES), pull, np.inf)


def _since(brake: Brake, time_s: Array) -> Array:
    """Time since the brake was last to engage; negative before the first time."""
    since = time_s - brake.first_s
    return np.where(since > 0.0, np.mod(since, brake.every_s), since) if brake.every_s else since


def _waited(brake: Brake, time_s: Array) -> Array:
    """For how long the motion has stood still, from slowing down on."""
    since = time_s - brake.first_s + SLOWS_S
    times = np.maximum(np.floor(since / brake.every_s), 0.0) if brake.every_s else 0.0
    now = since - times * brake.every_s
    slowing, speeding = (
        np.clip((now - begins) / SLOWS_S, 0.0, 1.0) for begins in (0.0, SLOWS_S + brake.for_s)
    )
    held = np.clip(now - SLOWS_S, 0.0, brake.for_s)
    lost = SLOWS_S * (_area(slowing) + speeding - _area(speeding))
    return np.asarray(times * (brake.for_s + SLOWS_S) + held + lost)


def _area(share: Array) -> Array:
    """Integral of a smooth step from 0 to 1."""
    return np.asarray(share**3 - 0.5 * share**4)
