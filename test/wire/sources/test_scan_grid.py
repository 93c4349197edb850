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

"""Readings of several rates on one grid of scans, worked by hand, and fields of messages."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass, field

import pytest

from flea_diag.errors import ConfigurationError, WireError
from flea_diag.wire.records import Scan
from flea_diag.wire.sources.field_path import FieldPath
from flea_diag.wire.sources.mapping import (
    HOLD,
    INTERPOLATE,
    MEAN,
    ChannelMapping,
    SourceMapping,
    SourceTerm,
)
from flea_diag.wire.sources.scan_grid import LOOK, ScanGrid

MS = 1_000_000
START_NS = 1_600_000_000_000 * MS


def channel(name: str, resample: str, age_s: float, terms: int = 1) -> ChannelMapping:
    parts = tuple(SourceTerm(1.0 - 2.0 * k, column=f"{name}{k}") for k in range(terms))
    return ChannelMapping(name, "m", parts, 2.0, 1.0, -9.0, 9.0, 10.0, resample, age_s, "m")


def grid(*channels: ChannelMapping) -> ScanGrid:
    return ScanGrid(SourceMapping("channels.yaml", "mine", "mapped", 10.0, channels))


def pushed(made: ScanGrid, readings: list[tuple[int, int, float]]) -> list[Scan]:
    """Scans of readings as (time in ms, number of the term, value)."""
    return [s for at, k, x in readings for s in made.push(START_NS + at * MS, [(k, x)])]


def rows(scans: list[Scan]) -> dict[int, tuple[float, ...]]:
    return {(scan.stamp_ns - START_NS) // MS: scan.values for scan in scans}


def test_a_reading_between_two_scans_is_interpolated_or_held() -> None:
    made = grid(channel("a", INTERPOLATE, 0.3), channel("b", HOLD, 0.3))
    readings = [(0, 0, 0.0), (0, 1, 5.0), (140, 0, 1.4), (150, 1, 7.0), (260, 0, 2.6)]
    found = rows(pushed(made, readings) + list(made.finish()))
    assert found[0] == (1.0, 11.0)
    assert found[100] == pytest.approx((3.0, 11.0)), "2 * 1.0 + 1, and 2 * 5 + 1"
    assert found[200] == pytest.approx((5.0, 15.0))


@pytest.mark.parametrize("resample", [HOLD, INTERPOLATE])
def test_what_lies_between_readings_of_a_slower_source_is_left_out(resample: str) -> None:
    """Half the declared rate: bridged until that is known, and not from then on."""
    made = grid(channel("a", resample, 0.3))
    readings = [(200 * k, 0, 0.1 * k) for k in range(LOOK + 12)]
    found = rows(pushed(made, readings) + list(made.finish()))
    assert made.slower() == {"a": 5.0}
    known = 200 * LOOK
    assert all(math.isfinite(found[at][0]) for at in range(0, known - 200, 100))
    assert all(math.isfinite(found[at][0]) for at in range(known + 400, 7000, 200))
    assert all(math.isnan(found[at][0]) for at in range(known + 500, 7000, 200))


def test_a_source_that_may_be_slow_is_bridged() -> None:
    """``age_s`` says that a reading may be as old."""
    made = grid(channel("a", HOLD, 0.5))
    found = rows(pushed(made, [(200 * k, 0, 0.1 * k) for k in range(2 * LOOK)]))
    assert made.slower() == {}
    assert all(math.isfinite(row[0]) for row in found.values())


def test_single_losses_are_no_slower_source() -> None:
    made = grid(channel("a", INTERPOLATE, 0.3))
    readings = [(100 * k, 0, 0.1 * k) for k in range(4 * LOOK) if k % 5 != 3]
    found = rows(pushed(made, readings) + list(made.finish()))
    assert made.slower() == {}
    assert all(math.isfinite(row[0]) for row in found.values())


def test_the_mean_takes_the_readings_nearest_to_a_scan_each_once() -> None:
    made = grid(channel("a", MEAN, 0.3), channel("b", HOLD, 9.0))
    fast = [(at, 0, 1.0 if (at // 20) % 2 else -1.0) for at in range(0, 401, 20)]
    alive = [(at, 1, 0.0) for at in range(0, 401, 100)]
    found = rows(pushed(made, sorted(fast + alive)))
    # -1 at 0, +1 at 20, -1 at 40; then 60 to 140, and 160 to 240: their sums are +1 and -1.
    assert [values[0] for values in found.values()] == pytest.approx(
        [2.0 * -1.0 / 3.0 + 1.0, 2.0 * 0.2 + 1.0, 2.0 * -0.2 + 1.0, 2.0 * 0.2 + 1.0]
    )
    assert max(found) == 300, "a scan waits for the readings after it"


def test_the_mean_of_a_source_slower_than_the_scans_is_held_up_to_its_age() -> None:
    made = grid(channel("a", MEAN, 0.25), channel("b", HOLD, 9.0))
    alive = [(at, 1, 0.0) for at in range(0, 901, 100)]
    found = rows(pushed(made, sorted([(0, 0, 3.0), (510, 0, 4.0), *alive])))
    known = {at: values[0] for at, values in found.items() if math.isfinite(values[0])}
    assert known == {0: 7.0, 100: 7.0, 200: 7.0, 500: 9.0, 600: 9.0}


def test_a_drive_at_1_khz_does_not_alias_into_the_scans() -> None:
    """Ripple of 90 Hz on a constant: points of it at 100 Hz are a wave of 10 Hz, means are not."""
    ripple = [(at, 0, math.sin(2.0 * math.pi * 0.09 * at)) for at in range(4001)]
    swing = {}
    for how in (INTERPOLATE, MEAN):
        row = ChannelMapping(
            "a", "m", (SourceTerm(column="a"),), 1.0, 0.0, -9.0, 9.0, 1000.0, how, 0.1, "m"
        )
        made = ScanGrid(SourceMapping("channels.yaml", "mine", "mapped", 100.0, (row,)))
        values = [scan.values[0] for scan in pushed(made, ripple)]
        swing[how] = max(values[5:-5])
    assert swing[INTERPOLATE] > 0.95
    # Ten points of a wave leave Dirichlet's share of it.
    share = math.sin(0.9 * math.pi) / (10.0 * math.sin(0.09 * math.pi))
    assert 0.9 * share < swing[MEAN] <= share + 1e-9


def test_a_sum_has_a_reading_where_all_its_terms_have() -> None:
    made = grid(channel("a", INTERPOLATE, 0.3, terms=2))
    readings = [(0, 0, 8.0), (100, 0, 8.0), (100, 1, 3.0), (200, 0, 9.0), (200, 1, 3.0)]
    found = rows(pushed(made, readings) + list(made.finish()))
    assert math.isnan(found[0][0])
    assert (found[100][0], found[200][0]) == (11.0, 13.0)


def test_a_reading_is_used_up_to_its_age() -> None:
    made = grid(channel("a", HOLD, 0.3), channel("b", INTERPOLATE, 0.3), channel("c", HOLD, 9.0))
    alive = [(at, 2, 0.0) for at in range(0, 1001, 100)]
    late = [(0, 0, 1.0), (0, 1, 1.0), (500, 1, 2.0), (600, 1, 2.0)]
    found = rows(pushed(made, sorted(alive + late)))
    held = {at for at, values in found.items() if math.isfinite(values[0])}
    drawn = {at for at, values in found.items() if math.isfinite(values[1])}
    assert held == {0, 100, 200, 300}
    assert drawn == {0, 500, 600}, "no line over a gap of 0.5 s"
    assert max(found) == 700, "a topic that has ended is waited for up to its age"


def test_a_scan_waits_for_the_reading_after_it_no_longer_than_its_age() -> None:
    made = grid(channel("a", INTERPOLATE, 0.3), channel("b", HOLD, 9.0))
    assert rows(pushed(made, [(0, 0, 0.0), (0, 1, 0.0), (100, 1, 0.0), (250, 1, 0.0)])).keys() == {
        0
    }
    assert rows(pushed(made, [(410, 1, 0.0)])).keys() == {100}


def test_the_order_of_arrival_within_the_wait_does_not_matter() -> None:
    draw = random.Random(5)
    readings = [(10 * k, 0, math.sin(k)) for k in range(200)]
    readings += [(25 * k + 3, 1, math.cos(k)) for k in range(80)]
    readings.sort()
    jittered = sorted(readings, key=lambda r: r[0] + 19.0 * draw.random() * (r[1] == 1))
    assert jittered != readings
    made = [grid(channel("a", INTERPOLATE, 0.3), channel("b", HOLD, 0.3)) for _ in range(2)]
    plain, mixed = pushed(made[0], readings), pushed(made[1], jittered)
    assert len(plain) > 15
    assert repr(plain) == repr(mixed)


def test_what_comes_twice_or_backward_is_counted_and_left_out() -> None:
    made = grid(channel("a", HOLD, 0.3))
    found = rows(
        pushed(made, [(0, 0, 1.0), (100, 0, 2.0), (100, 0, 9.0), (50, 0, 9.0), (230, 0, 3.0)])
    )
    assert found == {0: (3.0,), 100: (5.0,), 200: (5.0,)}
    assert made.counts["disordered"] == 2


def test_single_leaps_are_errors_ten_in_a_row_are_a_new_stream() -> None:
    made = grid(channel("a", HOLD, 0.3))
    hour = 3_600_000
    before = pushed(made, [(0, 0, 1.0), (hour, 0, 7.0), (100, 0, 2.0), (230, 0, 3.0)])
    assert rows(before) == {0: (3.0,), 100: (5.0,), 200: (5.0,)}
    assert made.counts["leaping"] == 1
    after = rows(pushed(made, [(hour + 100 * k, 0, 4.0) for k in range(12)]))
    assert set(after) == {hour + 900, hour + 1000}, "none of the hour between, and one waits"
    assert made.streams == 2
    assert not rows(pushed(made, [(0, 0, 1.0)])), "a looping source begins again the same way"


# --- fields --------------------------------------------------------------------------------------


@dataclass
class Pair:
    key: str
    value: str


@dataclass
class Interface:
    interface_names: list[str]
    values: list[float]


@dataclass
class State:
    """Like JointState and DynamicJointState in one."""

    name: list[str] = field(default_factory=lambda: ["shoulder", "elbow"])
    effort: list[float] = field(default_factory=lambda: [1.0, 2.0])
    joints: list[Interface] = field(
        default_factory=lambda: [
            Interface(["effort"], [3.0]),
            Interface(["x", "effort"], [0.0, 4.0]),
        ]
    )
    pairs: list[Pair] = field(default_factory=lambda: [Pair("celsius", "21.5"), Pair("t", "hot")])
    on: bool = True


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("effort[1]", 2.0),
        ("effort[elbow]", 2.0),
        ("effort[2]", None),
        ("effort[wrist]", None),
        ("joints[elbow].values[effort]", 4.0),
        ("joints[0].values[0]", 3.0),
        ("pairs[celsius].value", 21.5),
        ("on", 1.0),
    ],
)
def test_a_number_of_a_message(path: str, value: float | None) -> None:
    assert FieldPath.parsed(path, "here").read(State()) == value


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ("efort[1]", "no field 'efort' in .*, it has name, effort, joints, pairs, on"),
        ("effort", r"effort is an array: choose one element, as effort\[0\]"),
        ("pairs[t].value", "pairs.* is 'hot', which is no number"),
        ("on[1]", "the field is no array"),
    ],
)
def test_what_is_no_number_is_refused(path: str, words: str) -> None:
    with pytest.raises(WireError, match=words):
        FieldPath.parsed(path, "here").read(State())


@pytest.mark.parametrize("path", ["", "a..b", "a[", "a[]", "a.b c", "a[1][2]", "9a", "a" * 400])
def test_what_is_no_path_is_refused(path: str) -> None:
    with pytest.raises(ConfigurationError, match="is no field of a message: write it like"):
        FieldPath.parsed(path, "channels.yaml: motor_current")
