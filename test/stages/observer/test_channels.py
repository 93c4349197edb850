"""Channels of a stream of scans: what is usable, compiled or not, in whatever blocks."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flea_diag.core.residuals.residual_rows import CHANNELS
from flea_diag.stages.observer.channels import Channels
from flea_diag.wire.blocks import ScanBlock
from flea_diag.wire.records import ChannelInfo, ChannelTable

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
    channels = Channels(CHANNELS[:-3], "distrusted", backend)
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
