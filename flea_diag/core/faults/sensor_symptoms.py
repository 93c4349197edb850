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

"""Which residuals of a stand a fault of a sensor moves by itself, whatever the plant does."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from flea_diag.core.frozen import Frozen


@dataclass(frozen=True)
class SensorSymptoms(Frozen):
    """What isolation looks up about sensors.

    Attributes
    ----------
    positions
        Channels that read a displacement and have a residual of that name, which is its step.
    motion
        Channels of the motion: positions and speed.
    twins
        Differences between two sensors of one motion.
    stretched
        Those of them that hold what lies between the two places.
    own
        Residual in no signature table -> sensors whose faults alone move it.
    death_unseen
        Channels whose own tests cannot tell a reading that stands still from a healthy one.
    death_s
        How long that takes them where readings come seldom, s.
    """

    positions: tuple[str, ...] = ()
    motion: tuple[str, ...] = ()
    twins: tuple[str, ...] = ()
    stretched: tuple[str, ...] = ()
    own: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    death_unseen: tuple[str, ...] = ()
    death_s: Mapping[str, float] = field(default_factory=dict)
