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

"""The link of the simulated axis at another level: within its band nothing, below it a sag."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import pytest
from support import stands
from support.stand_runs import records

from flea_diag.configuration.component import make_pipeline
from flea_diag.configuration.stand import load_stand
from flea_diag.wire.records import AmbiguityGroup, ChannelTable, Detection, Record, Scan

SAGS_S = 8.0


@cache
def run() -> tuple[Record, ...]:
    """Sixteen seconds of a healthy axis of the calibration."""
    motion = {"kind": "sine", "amplitude_m": 0.25, "frequency_hz": 0.2, "centre_m": 0.6}
    made = records(machine="axis", motion=motion, duration_s=16.0, unit_seed=201)
    return tuple(r for r in made if isinstance(r, (ChannelTable, Scan)))


def lowered(volts: float) -> list[Record]:
    """What comes of the run whose link has so much less from ``SAGS_S`` on."""
    first = next(r for r in run() if isinstance(r, Scan))
    column = first.channels.index("bus_voltage")

    def sagged(scan: Scan) -> Scan:
        values = list(scan.values)
        values[column] -= volts
        return replace(scan, values=tuple(values))

    given = [
        sagged(r) if isinstance(r, Scan) and r.stamp_ns - first.stamp_ns >= SAGS_S * 1e9 else r
        for r in run()
    ]
    return list(stands.replay(make_pipeline(load_stand("axis"), observer_backend="numpy"), given))


@pytest.mark.parametrize("volts", [0.0, 20.0])
def test_within_its_band_nothing_is_said(volts: float) -> None:
    assert not any(isinstance(r, Detection) and r.detected for r in lowered(volts))


def test_below_its_band_it_is_named() -> None:
    told = lowered(45.0)
    groups = [r for r in told if isinstance(r, AmbiguityGroup)]
    members = {member.fault for member in groups[-1].members}
    assert "supply_sag" in members
    assert members <= {"supply_sag", "bus_voltage_bias", "bus_voltage_scaling"}
    detected_s = (groups[-1].detected_stamp_ns - run()[0].stamp_ns) / 1e9
    assert SAGS_S < detected_s < SAGS_S + 1.0
