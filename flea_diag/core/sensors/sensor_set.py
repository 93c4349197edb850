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

"""Which sensors of a stand are tested by themselves, and what healthy ones may do."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType

from flea_diag.core.frozen import Frozen

RESOLUTIONS = {
    "motor_current": 1e-3,
    "motor_speed": 0.5,
    "actuator_position": 1e-6,
    "load_position": 1e-6,
    "load_force": 0.1,
    "motor_temperature": 1e-2,
    "nut_temperature": 1e-2,
    "ambient_temperature": 1e-3,
}
"""Noise below which a standard channel counts as quiet (SI).

That of an encoder is about its counts: at rest it reads zero whatever its noise."""
FINEST = 0.02
"""The same of any other channel, as a share of its described noise."""
AT_REST = 5.0
"""No position that has gone less than so many of its noises within a few scans moves."""
TESTS = ("noise", "stuck", "dropout")


@dataclass(frozen=True, eq=False)
class SensorSet(Frozen):
    """Sensors that are tested by themselves, in the order of their tests.

    Voltages for held readings alone: a drive that switches has no noise of its own, and
    ``plausibility`` judges it.

    Attributes
    ----------
    resolutions
        Channel -> noise below which it counts as quiet.
    positions
        Readings that cannot jump, those of a mass -> the way below which they are at rest.
    speed
        Reading that is exactly zero at rest: to hold it there is right; empty: none.
    paired
        Two positions read one motion: a step that both share is an impact.
    held
        Voltages, tested for readings that are held alone -> the command that they follow; empty:
        none is read.
    period_s
        Time between two scans for which the noises are stated; 0: as it is.
    """

    resolutions: Mapping[str, float]
    positions: Mapping[str, float]
    speed: str = ""
    paired: bool = False
    held: Mapping[str, str] = field(default_factory=dict)
    period_s: float = 0.0

    @classmethod
    def of(
        cls,
        noises: Mapping[str, float],
        positions: Mapping[str, str],
        speed: str,
        held: Mapping[str, str] = MappingProxyType({}),
        period_s: float = 0.0,
    ) -> SensorSet:
        """From the described noise of each channel, and the unit of each position."""
        fine = {n: RESOLUTIONS.get(n, FINEST * noise) for n, noise in noises.items()}
        rest = {name: AT_REST * noises[name] for name in positions}
        paired = len(positions) == 2 and len(set(positions.values())) == 1
        return cls(fine, rest, speed, paired, held, period_s)

    def speed_of_a_count(self, period_s: float) -> float:
        """About the speed of one count of the encoder in a scan, the larger the shorter it is."""
        return self.resolutions.get(self.speed, 0.0) * max(1.0, self.period_s / period_s)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Residuals that the tests fill: steps, each test of each channel, those of ``held``."""
        tests = (f"{name}_{test}" for test in TESTS for name in self.resolutions)
        return (*self.positions, *tests, *(f"{name}_stuck" for name in self.held))

    def channel_of(self, name: str) -> str:
        """Channel that one of ``names`` tests."""
        return name if name in self.positions else name.rpartition("_")[0]
