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

"""Channels of a stream of scans: what is usable, in whatever blocks, and what is reported."""

from __future__ import annotations

import math

import numpy as np
import pytest
from support import stands
from support.observed import FLEA_COUNTS
from support.observer_scans import after, counters, decisions, healthy, quality

from flea_diag.configuration.description import compiled_relations
from flea_diag.stages.observer.channels import Channels
from flea_diag.wire.blocks import ScanBlock
from flea_diag.wire.records import ChannelInfo, ChannelTable, DataQuality, Quality, Residual, Scan

pytestmark = pytest.mark.slow

FLEA = compiled_relations("actuator.yaml").residuals

NAMES = ("load_force", "unknown", "motor_current", "actuator_position")
SCANS = 400


def values() -> np.ndarray:
    """Readings of which some are missing, out of range, at its end, or repeated by the driver."""
    found = np.random.default_rng(7).standard_normal((SCANS, len(NAMES)))
    found[100:160, 2] = math.nan
    found[200, 0], found[210:225, 3] = 1e12, 9.0
    found[300:303] = found[299]
    return found


def judged(backend: str, block: int) -> tuple[bytes, list[int], list[object]]:
    channels = Channels(FLEA, FLEA.channels[:-3], "distrusted", backend, counts=FLEA_COUNTS)
    rows = tuple(ChannelInfo(name, "", -9.0, 9.0, 100.0) for name in NAMES)
    channels.take_ranges(ChannelTable(0, "stand", rows))
    stamps_ns, table = np.arange(SCANS) * 10_000_000, values()
    usable, changed = [], []
    for start in range(0, SCANS, block):
        part = slice(start, start + block)
        reading = channels.read(ScanBlock(stamps_ns[part], NAMES, table[part]))
        trusted = np.ones(len(reading.raw), dtype=bool)
        changed.append(channels.judge(stamps_ns[part], reading, trusted))
        usable.append(reading.usable)
    return np.concatenate(usable).tobytes(), changed, list(channels.states({}))


@pytest.mark.parametrize("block", [1, 7, SCANS])
def test_compiled_gives_the_bits_of_numpy(block):
    pytest.importorskip("numba")
    one, other = judged("numpy", block), judged("numba", block)
    assert one == other
    by_name = {state.channel: dict(state.counters) for state in one[2]}
    assert by_name["motor_current"]["missing"] >= 60
    assert by_name["load_force"]["out_of_range"] == 1
    assert by_name["load_force"]["stale"] == 3


def test_blocks_give_what_scans_one_by_one_give():
    assert judged("auto", 1)[0] == judged("auto", 64)[0]
    assert judged("auto", 1)[2] == judged("auto", 64)[2]


def test_a_channel_that_goes_missing_is_said_once():
    lacking = [
        s if k < 1000 else Scan(s.stamp_ns, s.channels[1:], s.values[1:])
        for k, s in enumerate(healthy())
    ]
    assert healthy()[0].channels[0] == "motor_current"
    out = stands.replay(stands.observer(), lacking)
    said = stands.of(DataQuality, out)
    # The second time because the offsets were learned.
    states = [quality(r, "motor_current").quality for r in said]
    assert states[:3] == [Quality.GOOD, Quality.GOOD, Quality.BAD]
    assert set(states[3:]) == {Quality.BAD}  # what its tests lack is said later, and at the end
    assert quality(said[-1], "motor_current").since_ns == said[2].stamp_ns
    assert quality(said[-1], "motor_current").read_ns == healthy()[999].stamp_ns
    assert quality(said[-1], "motor_current").reason.startswith("sensor dead, other channels valid")
    assert decisions(out) == []
    last = stands.of(Residual, out)[-1]
    assert math.isnan(last.values[last.names.index("parity_mechanical")])
    assert math.isfinite(last.values[last.names.index("nut_temperature")])


@pytest.mark.parametrize("frozen", [True, False])
def test_a_dead_driver_is_neither_a_dead_sensor_nor_a_fault(frozen: bool):
    """It goes on sending, what it read last or nothing at all."""
    last = healthy()[999].values if frozen else (math.nan,) * len(healthy()[0].values)
    dead = [Scan(s.stamp_ns, s.channels, last) for s in healthy()[1000:1300]]
    stage = stands.observer()
    out = stands.replay(stage, [stands.table(), *healthy()[:1000], *dead])
    assert decisions(out) == []
    said = stands.of(DataQuality, out)[-1]
    assert quality(said, "sensors/slow").quality is Quality.BAD
    assert quality(said, "sensors/slow").reason.startswith("DAQ frozen")
    assert not any("sensor dead" in row.reason for row in said.channels)
    assert counters(stage, dead[-1], "load_force")["stale"] == 300 * frozen
    # It comes back, and all is well.
    again = stands.replay(stage, healthy()[1300:])
    assert decisions(again) == []
    assert {row.quality for row in stands.of(DataQuality, again)[-1].channels} <= {
        Quality.GOOD,
        Quality.ABSENT,
    }


def test_values_out_of_range_are_not_used():
    spoilt = [
        after(s, motor_temperature=2e4) if k % 50 == 0 else s for k, s in enumerate(healthy())
    ]
    stage = stands.observer()
    out = stands.replay(stage, [stands.table(), *spoilt])
    assert decisions(out) == []
    assert counters(stage, spoilt[-1], "motor_temperature")["out_of_range"] == 40
