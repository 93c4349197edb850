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

"""Runs into a stop on the simulated stand: what is void, what goes on, and what is told."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from support import stands
from support.observed import BACKENDS
from support.observer_scans import after
from support.stand_runs import records

from flea_diag.configuration import knowledge as of_stand
from flea_diag.configuration.calibrations import learned
from flea_diag.configuration.stand import load_stand
from flea_diag.core.detection.detection import TestResults as Results
from flea_diag.core.residuals.stop import Stop
from flea_diag.stages.isolator.isolator import IsolatorParameters, IsolatorStage
from flea_diag.stages.observer.condition_watch import UNKNOWN, UNSEEN, ConditionWatch, Voided
from flea_diag.stages.observer.detection_episode import DetectionEpisode
from flea_diag.stages.observer.observer import ObserverStage
from flea_diag.stages.observer.observer_parameters import ObserverParameters
from flea_diag.stages.pipeline import Pipeline
from flea_diag.wire.blocks import ResidualBlock, ScanBlock
from flea_diag.wire.records import (
    END_OF_TRAVEL,
    TAKEN_BACK,
    AmbiguityGroup,
    ChannelInfo,
    ChannelQuality,
    ChannelTable,
    DataQuality,
    Detection,
    Outcome,
    Quality,
    Record,
    Residual,
    Scan,
)

pytestmark = pytest.mark.slow

UPPER = {"kind": "triangle", "amplitude_m": 0.03, "frequency_hz": 0.2, "centre_m": 0.085}
LOWER = {**UPPER, "centre_m": 0.015}
NUT = {"stopped": "nut", "overtravel_m": 0.015}


@cache
def pressed(end: str = "upper") -> tuple[Record, ...]:
    """Twelve seconds of a healthy unit that is commanded past one end, over and over."""
    motion = UPPER if end == "upper" else LOWER
    run = records(motion=motion, travel=NUT, duration_s=12.0, seed=18)
    return tuple(r for r in run if isinstance(r, (ChannelTable, Scan)))


def diagnosed(backend: str = "auto") -> Pipeline:
    calibration = learned(load_stand())
    known = of_stand.knowledge(load_stand(), calibration)
    parameters = ObserverParameters(observer_backend=backend)
    return Pipeline(
        (
            ObserverStage(calibration, known.effects, parameters),
            IsolatorStage(known, IsolatorParameters()),
        )
    )


@cache
def told(end: str = "upper") -> tuple[Record, ...]:
    return tuple(stands.replay(diagnosed(), pressed(end)))


def once() -> tuple[Record, ...]:
    """Seven seconds of it: one contact from its begin to its end."""
    return pressed()[:700]


@cache
def told_once(backend: str) -> tuple[Record, ...]:
    return tuple(stands.replay(diagnosed(backend), once()))


def contacts(said: tuple[Record, ...]) -> list[ChannelQuality]:
    """Its row in every DataQuality that has one."""
    rows = [row for record in stands.of(DataQuality, said) for row in record.channels]
    return [row for row in rows if row.channel == END_OF_TRAVEL]


def touches_s(run: tuple[Record, ...], end_m: float) -> list[float]:
    """When the true position comes to 0.2 mm of an end, by the encoder."""
    scans = stands.of(Scan, run)
    column = scans[0].channels.index("actuator_position")
    near = np.array([abs(s.values[column] - end_m) < 0.2e-3 for s in scans])
    begins = np.flatnonzero(near[1:] & ~near[:-1]) + 1
    return [(scans[k].stamp_ns - scans[0].stamp_ns) / 1e9 for k in begins]


@pytest.mark.parametrize(("end", "end_m"), [("upper", 0.1), ("lower", 0.0)])
def test_contact_is_told_with_its_end_and_time_and_no_fault_is_called(
    end: str, end_m: float
) -> None:
    first_ns = stands.of(Scan, pressed(end))[0].stamp_ns
    rows = contacts(told(end))
    since_s = sorted({(row.since_ns - first_ns) / 1e9 for row in rows})
    touched_s = touches_s(pressed(end), end_m)
    assert len(touched_s) >= 2
    for touch_s in touched_s:
        assert any(touch_s < begun_s < touch_s + 0.6 for begun_s in since_s)
    assert all(row.quality is Quality.SATURATED and f"the {end} end" in row.reason for row in rows)
    assert not stands.of(Detection, told(end))


def test_the_end_of_the_contact_is_told() -> None:
    """The last DataQuality of a run that has left its stop has no such row."""
    with_row = [END_OF_TRAVEL in {row.channel for row in q.channels}
                for q in stands.of(DataQuality, told())]  # fmt: skip
    assert any(with_row)
    assert not with_row[-1] or with_row.count(False) > 1


def test_the_verdict_says_since_when() -> None:
    words = [group.words for group in stands.of(AmbiguityGroup, told())]
    assert any("at the upper end of its travel (0.1 m) since " in text for text in words)
    assert "end of its travel" not in words[0]


def test_what_holds_the_reaction_or_a_clipped_reading_is_void_and_nothing_else() -> None:
    """The position of the load stands at the end of its scale."""
    first_ns = contacts(told())[0].since_ns
    during = [r for r in stands.of(Residual, told()) if 0 <= r.stamp_ns - first_ns < 200_000_000]
    assert len(during) == 20
    for residual in during:
        void = {n for n, v in zip(residual.names, residual.values, strict=True) if np.isnan(v)}
        known = set(residual.names) - void
        assert {"parity_mechanical", "parity_mechanical_dn", "parity_kinematic",
                "innovation_motor_speed"} <= void  # fmt: skip
        assert {"parity_electrical", "parity_drive", "parity_speed",
                "motor_temperature", "actuator_position_stuck"} <= known  # fmt: skip
        assert np.isfinite(residual.estimates).any()
        assert not residual.health[-1]


@pytest.mark.in_turn(2)
@pytest.mark.parametrize(("backend", "length"), list(zip(BACKENDS, (7, 400), strict=False)))
def test_blocks_give_the_records_of_single_scans(backend: str, length: int) -> None:
    stage, run = diagnosed(backend), once()
    scans = stands.of(Scan, run)
    out = list(stage.handle(run[0]))
    for start in range(0, len(scans), length):
        part = scans[start : start + length]
        block = ScanBlock(
            np.array([s.stamp_ns for s in part]),
            part[0].channels,
            np.array([s.values for s in part]),
        )
        for made in stage.handle_block(block):
            out += made.records() if isinstance(made, ResidualBlock) else [made]
    out += stage.finish()
    for kind in (Residual, DataQuality, AmbiguityGroup):
        one, many = (list(map(repr, stands.of(kind, r))) for r in (told_once(backend), out))
        assert one == many


def test_both_backends_find_the_same_contacts() -> None:
    found = [contacts(told_once(backend)) for backend in BACKENDS]
    assert found[0]
    assert all(rows == found[0] for rows in found)


@pytest.mark.parametrize("reading_m", [0.0, 0.1])
def test_a_position_that_dies_at_an_end_is_no_contact(reading_m: float) -> None:
    fault = {"fault": "actuator_position_dead", "onset_s": 8.0, "size": reading_m, "where": "daq"}
    run = records(faults=[fault], duration_s=12.0, load={"constant_n": 150.0})
    said = stands.replay(diagnosed(), [r for r in run if isinstance(r, (ChannelTable, Scan))])
    assert contacts(tuple(said)) == []
    assert "actuator_position_dead" in stands.members(stands.verdict(said))


@pytest.mark.parametrize("lost", [("actuator_position", "load_position"), ("load_position",)])
def test_where_no_position_is_read_the_stop_may_hold_the_part(lost: tuple[str, ...]) -> None:
    """Readings are missing from 4 s on; without any, what would hold the reaction is void."""
    missing = dict.fromkeys(lost, float("nan"))
    given, begins_ns = [], stands.of(Scan, pressed())[0].stamp_ns + 4 * 10**9
    for record in pressed():
        if isinstance(record, ChannelTable):
            given.append(record)
        elif record.stamp_ns - begins_ns < 10**9:
            given.append(after(record, **missing) if record.stamp_ns >= begins_ns else record)
    last = stands.of(Residual, stands.replay(diagnosed(), given))[-30:]
    tested = {name for r in last for name, v in zip(r.names, r.values, strict=True) if v == v}
    assert ("parity_mechanical" in tested) == (len(lost) == 1)
    assert "parity_electrical" in tested


@cache
def held_back() -> tuple[Record, ...]:
    """For 0.7 s before an arrival at the end the drive needs 500 N more than the balance knows."""
    run = [r for r in records(motion=UPPER, travel=NUT, duration_s=20.0, seed=18)
           if isinstance(r, (ChannelTable, Scan))]  # fmt: skip
    scans = stands.of(Scan, run)
    column = scans[0].channels.index("actuator_position")
    stamps_s = [(s.stamp_ns - scans[0].stamp_ns) / 1e9 for s in scans]
    arrival_s = next(t for t, s in zip(stamps_s, scans, strict=True)
                     if t > 9.5 and s.values[column] > 0.098)  # fmt: skip
    more = {"motor_current": 500.0 / 177.0}
    more |= dict.fromkeys(("motor_voltage", "commanded_voltage"), 2.95 * 500.0 / 177.0)
    return tuple(
        after(r, **{n: r.values[r.channels.index(n)] + by for n, by in more.items()})
        if isinstance(r, Scan) and 0.0 < arrival_s - (r.stamp_ns - scans[0].stamp_ns) / 1e9 < 0.7
        else r
        for r in run
    )


@pytest.mark.in_turn(2)
def test_an_alarm_just_before_contact_is_taken_back_and_the_verdict_says_why() -> None:
    said = stands.replay(diagnosed(), held_back())
    opened, cleared = stands.of(Detection, said)
    assert opened.detected
    assert 0.0 < (cleared.stamp_ns - opened.stamp_ns) / 1e9 < 2.0
    assert cleared.test.startswith(f"{TAKEN_BACK}: ")
    last = stands.of(AmbiguityGroup, said)[-1]
    assert (last.outcome, last.episode) == (Outcome.NOMINAL, 0)
    assert "alarm 1 taken back: " in last.words
    assert "void at the upper end of its travel (0.1 m), since 1" in last.words


@pytest.mark.parametrize(
    ("beyond", "age_s", "taken_back"),
    [
        (("parity_mechanical",), 1.9, True),
        (("parity_mechanical", "innovation_motor_speed"), 1.0, True),
        (("parity_mechanical",), 2.1, False),
        (("parity_mechanical", "parity_electrical"), 1.0, False),
        (("actuator_position_stuck",), 0.5, False),
    ],
)
def test_only_a_young_alarm_all_of_whose_residuals_are_void_is_taken_back(
    beyond: tuple[str, ...], age_s: float, taken_back: bool
) -> None:
    rows = stands.relations().residuals
    columns = rows.columns(("parity_mechanical", "innovation_motor_speed"))
    results = Results(len(rows.rows))
    for name in beyond:
        results.z[0, rows.place[name]], results.k[0, rows.place[name]] = 9.0, 5.0
    episode = DetectionEpisode(rows, 30.0)
    episode.step(0, results)
    cleared = episode.take_back(round(age_s * 1e9), Voided("at its end", frozenset(columns), 2.0))
    assert (len(cleared) == 1) is taken_back
    assert episode.is_open is not taken_back


@pytest.mark.parametrize(("z", "taken_back"), [(9.0, True), (-9.0, False)])
def test_an_alarm_to_the_side_that_a_stop_never_pushes_is_not_taken_back(
    z: float, taken_back: bool
) -> None:
    rows = stands.relations().residuals
    column = rows.place["parity_mechanical"]
    results = Results(len(rows.rows))
    results.z[0, column], results.k[0, column] = z, 5.0
    episode = DetectionEpisode(rows, 30.0)
    episode.step(0, results)
    voided = Voided("at its upper end", frozenset({column}), 2.0, frozenset({(column, "-")}))
    assert (len(episode.take_back(10**9, voided)) == 1) is taken_back


def test_a_stop_moves_a_balance_to_one_side_only() -> None:
    stop = Stop(reactions={"parity_mechanical": -1.0, "parity_mechanical_dn": float("nan")})
    assert stop.contradicts(1) == {"parity_mechanical": "-"}
    assert stop.contradicts(-1) == {"parity_mechanical": "+"}


def watch(stop: Stop) -> ConditionWatch:
    calibration = learned(load_stand())
    known = of_stand.relations(load_stand(), calibration)
    return ConditionWatch(calibration, replace(known, stop=stop))


def test_a_description_without_travel_says_what_follows() -> None:
    stop = Stop(channels=("actuator_position",), reactions={"parity_mechanical": -1.0})
    lacking = watch(stop)
    (row,) = lacking.states()
    assert (row.channel, row.quality, row.reason) == (END_OF_TRAVEL, Quality.ABSENT, UNKNOWN)
    ranged = ChannelInfo("actuator_position", "m", 0.0, 0.05, 100.0)
    lacking.take_ranges(ChannelTable(0, "stand", (ranged,)))
    assert lacking.states() == ()


def test_a_travel_that_no_channel_reads_says_what_follows() -> None:
    (row,) = watch(Stop(0.0, 0.1, 0.002)).states()
    assert (row.quality, row.reason) == (Quality.ABSENT, UNSEEN)
