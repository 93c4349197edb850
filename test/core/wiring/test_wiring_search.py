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
from flea_diag.core.wiring.wiring_search import WiringFinding, WiringSearch, is_judged
from flea_diag.core.wiring.wiring_watch import LOOKS_S, WiringWatch
from flea_diag.stages.observer.regressor_table import RegressorTable

HEALTHY, JAM = 0, 2
STARTS = 100
"""Scans before the motion."""
CALIBRATION = learned(load_stand())
EFFECTS = effects(load_stand(), CALIBRATION)
KNOWN, COUNTS = EFFECTS.residuals, CALIBRATION.counts
COLUMNS = RegressorTable(EFFECTS, CALIBRATION.parameters).rows
FIRST = COUNTS.of(2.0)


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
    return WiringSearch(EFFECTS, CALIBRATION, COLUMNS)


def found_in(rows: np.ndarray) -> WiringFinding | None:
    return search().search(rows, search().hold(rows), FIRST)


def changed(channel: str, factor: float) -> np.ndarray:
    rows = readings(HEALTHY).copy()
    rows[:, KNOWN.index[channel]] *= factor
    return rows


def late(channel: str, scans: int) -> np.ndarray:
    rows, column = readings(HEALTHY).copy(), KNOWN.index[channel]
    rows[scans:, column] = readings(HEALTHY)[:-scans, column]
    return rows


def test_relations_hold_on_a_healthy_unit_and_not_on_a_jammed_one() -> None:
    check = RelationCheck(EFFECTS, CALIBRATION, COLUMNS)
    healthy, jammed = check.hold(readings(HEALTHY)), check.hold(readings(JAM, 14.0))
    assert healthy.is_typical
    assert not jammed.is_typical
    left = check.left_by_faults(readings(JAM, 14.0))
    assert left["jam"] < 0.5 * jammed.squares < left["motor_speed_scaling"]


def test_nothing_read_is_nothing_judged() -> None:
    empty = np.full_like(readings(HEALTHY), np.nan)
    held = search().hold(empty)
    assert (held.worst, is_judged(held)) == (0.0, False)
    assert found_in(empty) is None


def test_nothing_is_found_of_a_healthy_unit() -> None:
    assert found_in(readings(HEALTHY)) is None


def wired(fault: WiringFault) -> np.ndarray:
    """Readings with one channel wired so."""
    if fault.kind == LATE:
        return late(fault.channel, fault.scans)
    return changed(fault.channel, -1.0 if fault.kind == TURNED else fault.factor)


@pytest.mark.slow
@pytest.mark.parametrize(
    "fault",
    [
        WiringFault(TURNED, "motor_current"),
        WiringFault(FACTOR, "motor_voltage", factor=1e3),
        WiringFault(FACTOR, "actuator_position", factor=1.0 / 25.4),
        WiringFault(LATE, "commanded_voltage", scans=10),
        WiringFault(LATE, "motor_speed", scans=3),
    ],
    ids=lambda fault: fault.words(0.01),
)
def test_the_one_wiring_is_found(fault: WiringFault) -> None:
    finding = found_in(wired(fault))
    assert finding is not None
    assert finding.faults == (fault,)
    assert finding.is_sure
    assert finding.share > 1.0 > finding.left


def test_swapped_channels_are_found() -> None:
    rows = readings(HEALTHY).copy()
    one, other = KNOWN.index["motor_voltage"], KNOWN.index["commanded_voltage"]
    rows[:, [one, other]] = rows[:, [other, one]]
    finding = found_in(rows)
    assert finding is not None
    assert [w.kind for w in finding.faults] == [SWAPPED]


@pytest.mark.slow
@pytest.mark.parametrize(
    "fault",
    [
        # A voltage that is next to nothing beside its command is an open supply, too.
        WiringFault(FACTOR, "commanded_voltage", factor=1000.0),
        # A load that only ever stands against the motion is a drag where it is turned.
        WiringFault(TURNED, "load_force"),
    ],
    ids=lambda fault: fault.words(0.01),
)
def test_what_a_fault_explains_as_well_is_not_sure(fault: WiringFault) -> None:
    finding = found_in(wired(fault))
    assert finding is not None
    assert finding.faults == (fault,)
    assert not finding.is_sure


@pytest.mark.slow
@pytest.mark.parametrize(
    ("channel", "factor"), [("motor_speed", 1.3), ("motor_speed", 0.7), ("load_position", 0.7)]
)
def test_a_scaling_is_no_wiring(channel: str, factor: float) -> None:
    assert not search().hold(changed(channel, factor)).is_typical
    assert found_in(changed(channel, factor)) is None


def test_a_jam_is_no_wiring() -> None:
    assert found_in(readings(JAM, 14.0)) is None


def test_what_the_first_readings_do_not_show_is_no_wiring() -> None:
    later = changed("load_force", -1.0)
    later[:FIRST] = readings(HEALTHY)[:FIRST]
    assert not search().hold(later).is_typical
    assert found_in(later) is None


def test_a_dead_channel_is_no_unit() -> None:
    rows = changed("motor_voltage", 1.0)
    rows[:, KNOWN.index["motor_voltage"]] = 1e-3 * np.sin(np.arange(len(rows)))
    assert found_in(rows) is None


def watched(rows: np.ndarray, blocks: list[int], opened_at: int = -1) -> tuple[int, WiringWatch]:
    """Scans until something is found, or all, in blocks that end where it looks; and the watch."""
    watch = WiringWatch(search(), COUNTS, CALIBRATION.period_s)
    stamps, moving = np.arange(len(rows)) * 10_000_000, np.arange(len(rows)) >= STARTS
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


@pytest.mark.slow
def test_it_is_found_after_the_last_look_in_blocks_as_in_scans() -> None:
    turned = changed("load_force", -1.0)
    at, watch = watched(turned, [1])
    assert at == STARTS + COUNTS.of(LOOKS_S[-1])
    assert not watch.is_open
    assert watched(turned, [37])[0] == watched(turned, [400])[0] == at


@pytest.mark.parametrize("blocks", [[1], [37], [800]])
def test_a_healthy_stream_is_closed_after_the_first_look_without_an_event(
    blocks: list[int],
) -> None:
    at, watch = watched(readings(HEALTHY), blocks)
    assert (at, watch.is_open, watch.finding, watch.waits) == (800, False, None, False)


def test_a_fault_that_begins_later_is_not_looked_at() -> None:
    turned = changed("load_force", -1.0)
    turned[: STARTS + FIRST] = readings(HEALTHY)[: STARTS + FIRST]
    watch = watched(turned, [1], opened_at=STARTS + FIRST + 50)[1]
    assert (watch.finding, watch.waits) == (None, False)


def test_what_nothing_explains_need_not_wait() -> None:
    jammed = readings(JAM, 14.0)
    assert watched(jammed[:250], [1], opened_at=150)[1].waits
    assert not watched(jammed[:350], [1], opened_at=150)[1].waits


@pytest.mark.slow
def test_an_episode_waits_while_a_wiring_explains_it() -> None:
    turned = changed("load_force", -1.0)
    assert watched(turned[:550], [1], opened_at=150)[1].waits
    at, watch = watched(turned, [1], opened_at=150)
    assert at == STARTS + COUNTS.of(LOOKS_S[-1])
    assert not watch.waits


def test_at_rest_nothing_is_kept_and_an_episode_waits_for_ten_seconds() -> None:
    watch = WiringWatch(search(), COUNTS, CALIBRATION.period_s)
    rows, still = readings(HEALTHY), np.zeros(800, dtype=bool)
    stamps = np.arange(800) * 10_000_000
    assert watch.take(stamps, rows, rows, still) == 800
    watch.deviates(8_000_000_000)
    assert watch.waits
    assert watch.take(stamps + 8_000_000_000, rows, rows, still) == 800
    assert watch.take(stamps + 16_000_000_000, rows, rows, still) == 200
    watch.decide()
    assert watch.finding is None
    assert not watch.waits


@pytest.mark.slow
def test_a_channel_out_of_its_range_is_read_all_the_same() -> None:
    rows = changed("load_force", 1000.0)
    usable = rows.copy()
    usable[np.abs(rows[:, KNOWN.index["load_force"]]) > 2000.0, KNOWN.index["load_force"]] = np.nan
    watch = WiringWatch(search(), COUNTS, CALIBRATION.period_s)
    moving, first = np.ones(len(rows), dtype=bool), 0
    stamps = np.arange(len(rows)) * 10_000_000
    for last in (FIRST, COUNTS.of(LOOKS_S[-1])):
        part = slice(first, last)
        watch.take(stamps[part], rows[part], usable[part], moving[part])
        assert watch.due
        watch.decide()
        first = last
    assert watch.finding is not None
    assert watch.finding.faults == (WiringFault(FACTOR, "load_force", factor=1000.0),)
