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

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from flea_diag.stages.merge import Merge
from flea_diag.wire.records import (
    DataQuality,
    Detection,
    FeatureValue,
    Residual,
    Symbols,
    VibrationLevel,
)

MS = 1_000_000
WATERMARK = 200 * MS
RANKED = (DataQuality, Residual, Detection, Symbols, VibrationLevel)


def residual(stamp_ms: int) -> Residual:
    return Residual(stamp_ms * MS, (), (), (), ())


def detection(stamp_ms: int, episode: int = 1) -> Detection:
    return Detection(stamp_ms * MS, episode, True, "r", 9.0, 5.0, "")


def answer(stamp_ms: int) -> FeatureValue:
    return FeatureValue(stamp_ms * MS, 1, 1, "f", 0, 0, 1.0, "", "0", 0.0, 1.0, "", 0.1)


def merge(limit_ms: int = 2000) -> Merge:
    return Merge(Residual, WATERMARK, limit_ms * MS)


def drain(buffer: Merge, everything: bool = False) -> list:
    out = []
    while (record := buffer.pop(everything)) is not None:
        out.append(record)
    return out


STREAMS = {
    Residual: [residual(t) for t in range(0, 1000, 10)],
    Detection: [detection(t, n) for n, t in enumerate((300, 300, 620), 1)],
    Symbols: [Symbols(t * MS, n, ()) for n, t in enumerate((300, 310, 500, 800))],
    DataQuality: [DataQuality(t * MS, ()) for t in (0, 300, 305)],
    VibrationLevel: [VibrationLevel(t * MS, (), ()) for t in range(5, 1000, 100)],
}


@given(st.randoms(use_true_random=False), st.booleans())
def test_any_interleaving_within_the_watermark_gives_one_order(random, at_once):
    buffer, out = merge(), []
    waiting = {kind: list(records) for kind, records in STREAMS.items()}
    while any(waiting.values()):
        clock = waiting[Residual][0].stamp_ns if waiting[Residual] else None
        # The clock may run ahead of a topic by no more than the watermark.
        overdue = [
            kind
            for kind, records in waiting.items()
            if kind is not Residual and records and clock is not None
            and records[0].stamp_ns + WATERMARK <= clock
        ]  # fmt: skip
        kind = random.choice(overdue or [kind for kind, records in waiting.items() if records])
        buffer.push(waiting[kind].pop(0))
        if at_once:
            out += drain(buffer)
    out += drain(buffer, everything=True)
    everything = [record for records in STREAMS.values() for record in records]
    expected = sorted(everything, key=lambda r: (r.stamp_ns, RANKED.index(type(r))))
    assert out == expected
    assert buffer.late == 0


def test_nothing_leaves_before_the_clock_has_passed_by_the_watermark():
    buffer = merge()
    buffer.push(detection(100))
    assert drain(buffer) == []
    buffer.push(residual(299))
    assert drain(buffer) == []
    buffer.push(residual(300))
    assert drain(buffer) == [detection(100)]


def test_in_step_a_record_waits_for_the_next_scan_until_one_is_late():
    buffer = merge()
    buffer.in_step(True)
    for record in (residual(10), Symbols(10 * MS, 1, ()), detection(10)):
        buffer.push(record)
        assert drain(buffer) == []
    buffer.push(residual(20))
    assert drain(buffer) == [residual(10), detection(10), Symbols(10 * MS, 1, ())]
    buffer.push(VibrationLevel(5 * MS, (), ()))
    assert buffer.late == 1
    buffer.push(residual(30))
    assert drain(buffer) == []
    buffer.push(residual(220))
    assert drain(buffer) == [residual(20)]


def test_what_is_not_the_clock_moves_nothing():
    buffer = merge()
    buffer.push(residual(100))
    buffer.push(detection(9000))
    assert drain(buffer) == []


def test_what_comes_after_its_turn_is_late_and_counted():
    buffer = merge()
    for stamp_ms in (0, 100, 500):
        buffer.push(residual(stamp_ms))
    assert drain(buffer) == [residual(0), residual(100)]
    buffer.push(answer(99))
    buffer.push(answer(100))
    assert buffer.late == 1
    assert drain(buffer) == [answer(100)]


def test_how_things_stand_is_never_late_and_keeps_its_order():
    """What a node that comes back is told: latched records, older than all that it has seen."""
    buffer = merge()
    for stamp_ms in (0, 100, 500):
        buffer.push(residual(stamp_ms))
    drain(buffer)
    told = [DataQuality(MS, ()), detection(3), Symbols(4 * MS, 1, ())]
    for record in reversed(told):
        buffer.push(record)
    assert drain(buffer) == told
    assert buffer.late == 0


def test_a_hold_waits_for_the_answer_that_belongs_there():
    buffer = merge()
    for stamp_ms in range(0, 1000, 100):
        buffer.push(residual(stamp_ms))
    buffer.hold(250 * MS)
    assert [r.stamp_ns // MS for r in drain(buffer)] == [0, 100, 200]
    buffer.push(answer(250))
    assert drain(buffer) == [answer(250)]
    assert drain(buffer) == []
    buffer.hold(None)
    assert [r.stamp_ns // MS for r in drain(buffer)] == [300, 400, 500, 600, 700]


def test_a_hold_ends_at_its_limit():
    buffer = merge(limit_ms=400)
    buffer.hold(100 * MS)
    for stamp_ms in range(0, 701, 100):
        buffer.push(residual(stamp_ms))
    assert [r.stamp_ns // MS for r in drain(buffer)] == [0, 100]
    buffer.push(residual(800))
    assert [r.stamp_ns // MS for r in drain(buffer)] == [200, 300, 400, 500, 600]


def test_the_end_of_the_stream_lets_everything_go():
    buffer = merge()
    buffer.hold(0)
    for stamp_ms in (5, 3):
        buffer.push(detection(stamp_ms))
    assert drain(buffer, everything=True) == [detection(3), detection(5)]
    assert buffer.pop(everything=True) is None
