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

"""Noise model of the state observer, learned from nominal runs."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace

from flea_diag.core.frozen import Frozen

SUFFIXES = {"degC": "k"}
"""Ends of keys whose unit is that of a difference."""


def reading_key(channel: str, unit: str) -> str:
    """Name of the noise of one channel, such as ``motor_speed_rad_s``."""
    return f"{channel}_{SUFFIXES.get(unit) or re.sub('[^a-z0-9]+', '_', unit.lower())}"


@dataclass(frozen=True)
class ObserverNoise(Frozen):
    """Standard deviations of process and measurement noise.

    ``voltage_v`` is of the measured voltage as an input, ``voltage_sample_v`` of one raw PWM
    sample, ``voltage_walk_v`` how far the mean voltage wanders in one scan where nothing
    measures it, ``force_n`` what the model leaves out of the balance of forces in one scan,
    ``unmeasured_force_n`` what comes on top without a load cell. Temperatures wander by
    ``temperature_walk_k`` in a scan. ``readings`` are of single readings, by ``reading_key``; of a
    channel that is not among them the description says it. The defaults are where a fit starts.
    """

    voltage_v: float = 0.5
    voltage_sample_v: float = 8.3
    voltage_walk_v: float = 2.0
    force_n: float = 160.0
    unmeasured_force_n: float = 100.0
    temperature_walk_k: float = 0.0003
    readings: tuple[tuple[str, float], ...] = ()

    @classmethod
    def of(cls, levels: Mapping[str, float]) -> ObserverNoise:
        """From names and levels, as a calibration file holds them.

        Raises
        ------
        KeyError
            A level of the process is missing; the names are those of the fields.
        """
        own = {name: levels[name] for name in PROCESS}
        return cls(**own, readings=tuple((n, v) for n, v in levels.items() if n not in own))

    def to_mapping(self) -> dict[str, float]:
        """Inverse of ``of``."""
        known = asdict(self)
        return {name: known[name] for name in PROCESS} | dict(self.readings)

    def scaled(self, name: str, factor: float) -> ObserverNoise:
        """The same with one level by this factor."""
        if name in PROCESS:
            return replace(self, **{name: getattr(self, name) * factor})
        return replace(
            self, readings=tuple((n, v * factor if n == name else v) for n, v in self.readings)
        )


PROCESS = tuple(field.name for field in fields(ObserverNoise) if field.name != "readings")
"""Names of the levels that are not of one channel's readings."""
