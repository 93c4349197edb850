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

from copy import deepcopy
from functools import cache

import numpy as np
import pytest
from support.graph.runs import run_of

from flea_diag.configuration.calibrations import learned
from flea_diag.configuration.knowledge import effects
from flea_diag.configuration.stand import load_stand
from flea_diag.core.wiring.relation_check import RelationCheck
from flea_diag.core.wiring.wiring_fault import FACTOR, LATE, SWAPPED, TURNED, WiringFault
from flea_diag.core.wiring.wiring_search import WiringSearch
from flea_diag.core.wiring.wiring_watch import WiringWatch

HEALTHY, JAM = 0, 2
CALIBRATION = learned(load_stand())
RELATIONS = effects(load_stand(), CALIBRATION).relations
KNOWN = RELATIONS.residuals
COUNTS = CALIBRATION.counts


@cache
def readings(unit: int, first_s: float = 0.0) -> np.ndarray:
    """Rows of 8 s of one unit, from ``first_s`` on."""
    scans = [s for s in run_of(unit, 24.0).scans if s.stamp_ns >= 1e9 * first_s][:800]
    names = scans[0].channels
    rows = np.full((len(scans), len(KNOWN.channels)), np.nan)
    for name, column in KNOWN.index.items():
        rows[:, column] = [scan.values[names.index(name)] for scan in scans]
    return rows


@cache
def search() -> WiringSearch:
    return WiringSearch(RELATIONS, CALIBRATION)


def changed(channel: str, factor: float) -> np.ndarray:
    rows = readings(HEALTHY).copy()
    rows[:, KNOWN.index[channel]] *= factor
    return rows


def late(channel: str, scans: int) -> np.ndarray:
    rows, column = readings(HEALTHY).copy(), KNOWN.index[channel]
    rows[scans:, column] = readings(HEALTHY)[:-scans, column]
    return rows


def test_relations_hold_on_a_healthy_unit_and_not_on_a_jammed_one() -> None:
    check = RelationCheck(RELATIONS, CALIBRATION)
    healthy, jammed = check.hold(readings(HEALTHY)), check.hold(readings(JAM, 14.0))
    assert healthy.is_typical
    assert not jammed.holds


def test_nothing_read_is_nothing_judged() -> None:
    empty = np.full_like(readings(HEALTHY), np.nan)
    assert RelationCheck(RELATIONS, CALIBRATION).hold(empty).worst == 0.0
    assert search().search(empty, suspected=True).finding is None


def test_a_healthy_unit_is_not_searched_and_nothing_found_if_it_is() -> None:
    assert not search().search(readings(HEALTHY), suspected=False).contradicted
    assert search().search(readings(HEALTHY), suspected=True).finding is None


@pytest.mark.parametrize(
    ("rows", "fault"),
    [
        (changed("load_force", -1.0), WiringFault(TURNED, "load_force")),
        (changed("motor_current", -1.0), WiringFault(TURNED, "motor_current")),
        (changed("motor_voltage", 1e3), WiringFault(FACTOR, "motor_voltage", factor=1e3)),
        (
            changed("actuator_position", 1.0 / 25.4),
            WiringFault(FACTOR, "actuator_position", factor=1.0 / 25.4),
        ),
        (late("commanded_voltage", 10), WiringFault(LATE, "commanded_voltage", scans=10)),
        (late("motor_speed", 3), WiringFault(LATE, "motor_speed", scans=3)),
    ],
    ids=lambda value: value.words(0.01) if isinstance(value, WiringFault) else "",
)
def test_the_one_wiring_is_found(rows: np.ndarray, fault: WiringFault) -> None:
    finding = search().search(rows, suspected=False).finding
    assert finding is not None
    assert finding.faults == (fault,)
    assert finding.is_sure
    assert finding.share > 1.0 > finding.left


def test_swapped_channels_are_found() -> None:
    rows = readings(HEALTHY).copy()
    one, other = KNOWN.index["motor_voltage"], KNOWN.index["commanded_voltage"]
    rows[:, [one, other]] = rows[:, [other, one]]
    finding = search().search(rows, suspected=False).finding
    assert finding is not None
    assert [w.kind for w in finding.faults] == [SWAPPED]


@pytest.mark.parametrize(
    ("channel", "factor"), [("motor_speed", 1.3), ("motor_speed", 0.7), ("load_position", 0.7)]
)
def test_a_scaling_is_no_wiring(channel: str, factor: float) -> None:
    result = search().search(changed(channel, factor), suspected=True)
    assert result.contradicted
    assert result.finding is None


def test_a_jam_is_no_wiring() -> None:
    result = search().search(readings(JAM, 14.0), suspected=True)
    assert result.contradicted
    assert result.finding is None


def test_a_dead_channel_is_no_unit() -> None:
    rows = changed("motor_voltage", 1.0)
    rows[:, KNOWN.index["motor_voltage"]] = 1e-3 * np.sin(np.arange(len(rows)))
    assert search().search(rows, suspected=True).finding is None


def watched(rows: np.ndarray, blocks: list[int], opened_at: int = -1) -> tuple[int, WiringWatch]:
    """Scans until something is found, or all, in blocks that end where it looks; and the watch."""
    watch = WiringWatch(search(), COUNTS, CALIBRATION.period_s)
    stamps, moving = np.arange(len(rows)) * 10_000_000, np.arange(len(rows)) >= 100
    first, sizes = 0, iter(blocks * len(rows))
    while first < len(rows):
        last = min(first + next(sizes), len(rows))
        if first <= opened_at:
            last = min(last, opened_at + 1)
        before = deepcopy(watch)
        at = watch.take(stamps[first:last], *[rows[first:last]] * 2, moving[first:last])
        if watch.due and at < last - first - 1:
            watch, last = before, first + at + 1
            watch.take(stamps[first:last], *[rows[first:last]] * 2, moving[first:last])
        if last == opened_at + 1:
            watch.deviates(int(stamps[opened_at]))
        if watch.due:
            watch.decide()
        first = last
        if watch.finding is not None:
            break
    return first, watch


def test_it_is_found_after_five_seconds_of_motion() -> None:
    turned = changed("load_force", -1.0)
    at, watch = watched(turned, [1])
    assert at == 100 + COUNTS.of(5.0)
    assert not watch.is_open
    assert watched(turned, [37])[0] == watched(turned, [400])[0] == at


def test_nothing_is_found_of_a_healthy_stream() -> None:
    _, watch = watched(readings(HEALTHY), [1])
    assert (watch.is_open, watch.finding, watch.waits) == (True, None, False)


def test_what_nothing_explains_need_not_wait() -> None:
    _, watch = watched(readings(JAM, 14.0)[:350], [1], opened_at=150)
    assert watch.finding is None
    assert not watch.waits


def test_an_episode_waits_while_a_wiring_explains_it() -> None:
    turned = changed("load_force", -1.0)
    assert watched(turned[:550], [1], opened_at=150)[1].waits
    at, watch = watched(turned, [1], opened_at=150)
    assert at == 100 + COUNTS.of(5.0)
    assert not watch.waits


def test_at_rest_nothing_is_kept_and_an_episode_waits_for_eight_seconds() -> None:
    watch = WiringWatch(search(), COUNTS, CALIBRATION.period_s)
    rows, still = readings(HEALTHY), np.zeros(800, dtype=bool)
    assert watch.take(np.arange(800) * 10_000_000, rows, rows, still) == 800
    watch.deviates(8_000_000_000)
    assert watch.waits
    stamps = 8_000_000_000 + np.arange(1, 801) * 10_000_000
    assert watch.take(stamps, rows, rows, still) == 799
    watch.decide()
    assert watch.finding is None
    assert not watch.waits
    assert watch.is_open


def test_what_holds_is_looked_at_once_more_at_the_first_deviation() -> None:
    watch = watched(late("load_force", 5), [1])[1]
    assert watch.is_open
    assert watch.finding is None
    watch.deviates(9_000_000_000)
    assert watch.due
    watch.decide()
    assert watch.finding is None
    assert not watch.waits


def test_a_channel_out_of_its_range_is_read_all_the_same() -> None:
    rows = changed("load_force", 1000.0)
    usable = rows.copy()
    usable[np.abs(rows[:, KNOWN.index["load_force"]]) > 2000.0, KNOWN.index["load_force"]] = np.nan
    watch = WiringWatch(search(), COUNTS, CALIBRATION.period_s)
    moving = np.ones(len(rows), dtype=bool)
    stamps, first = np.arange(len(rows)) * 10_000_000, 0
    for last in (COUNTS.of(2.0), COUNTS.of(5.0)):
        part = slice(first, last)
        watch.take(stamps[part], rows[part], usable[part], moving[part])
        assert watch.due
        watch.decide()
        first = last
    assert watch.finding is not None
    assert watch.finding.faults == (WiringFault(FACTOR, "load_force", factor=1000.0),)
