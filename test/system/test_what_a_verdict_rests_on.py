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

"""Valid messages that would mislead: the right answer to each, in a live graph and replayed.

Where only scans are spoilt, a replay decides for all, and a live graph for one of each kind:
that both decide the same of the same scans is the subject of ``test_replay_bags.py``.
"""

from __future__ import annotations

import math
import random
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from support import in_turn
from support.disk.failing_disk import FailingDisk
from support.graph.network import Network
from support.graph.runs import Run, run_of
from support.graph.scheduler import Scheduler
from support.graph.world import World
from support.graph.wrong_wiring import Wiring, cut_off, late, scaled, swapped

from flea_diag.configuration.component import make_pipeline
from flea_diag.configuration.stand import load_stand
from flea_diag.nodes.stage_nodes import diagnoser
from flea_diag.tools.evaluate.case_run import in_blocks
from flea_diag.tools.replay import replay
from flea_diag.wire.bags.bag import read_bag
from flea_diag.wire.messages.codec import decode
from flea_diag.wire.records import (
    AmbiguityGroup,
    ChannelTable,
    Outcome,
    Record,
    Scan,
)

HEALTHY, JAM = 0, 2
"""Units by what is wrong with them (``support.graph.runs``)."""
LENGTH_S = 16.0
QUIET = {Outcome.NOT_OBSERVABLE, Outcome.NOMINAL}
FOUND = {Outcome.DETECTED, Outcome.ISOLATED, Outcome.INDISTINGUISHABLE}
BLIND = {Outcome.NOT_OBSERVABLE, Outcome.NOMINAL, Outcome.DATA_UNUSABLE}

UNKNOWN = {Outcome.DETECTED, Outcome.MODEL_MISMATCH, *BLIND}
"""What names no component for sure."""


@dataclass(frozen=True)
class Row:
    """What is sent, and what may be said of it; the last verdict is ``last``."""

    unit: int
    allowed: set[Outcome]
    last: Outcome
    words: str = ""
    spoilt: tuple[str, ...] = ()
    troubles: tuple[str, ...] = ()
    beside: tuple[int, int] | None = None
    """Unit of another stand on the same topics, and by how many ns it is later."""
    change: Any = None
    """Changes the scans of a run before they are sent."""


def missing(channel: str, every: int, run: Run) -> Run:
    """A reading of one channel is missing in each so-and-so-many scan, or in all but one of two."""
    column = run.scans[0].channels.index(channel)
    scans = []
    for number, scan in enumerate(run.scans):
        values = list(scan.values)
        if number % every == 0:
            values[column] = math.nan
        scans.append(replace(scan, values=tuple(values)))
    return replace(run, scans=tuple(scans))


def missing_at_random(share: float, run: Run) -> Run:
    """Any reading is missing with this probability."""
    draw = random.Random(2)
    return replace(
        run,
        scans=tuple(
            replace(s, values=tuple(math.nan if draw.random() < share else v for v in s.values))
            for s in run.scans
        ),
    )


def in_another_unit(channel: str, factor: float, run: Run) -> Run:
    """One channel is sent in another unit than is declared."""
    column = run.scans[0].channels.index(channel)
    scans = []
    for scan in run.scans:
        values = list(scan.values)
        values[column] *= factor
        scans.append(replace(scan, values=tuple(values)))
    return replace(run, scans=tuple(scans))


def rewired(change: Wiring, run: Run) -> Run:
    """A channel is wired wrong."""
    return replace(run, scans=change(run.scans))


def with_it_from_the_start(_run: Run) -> Run:
    """Of a longer run with a jam, only what comes a second after its onset."""
    run = run_of(JAM, 2.0 * LENGTH_S)
    start_ns = run.onset_ns + 1_000_000_000
    late_scans = (scan for scan in run.scans if scan.stamp_ns >= start_ns)
    return replace(run, scans=tuple(replace(s, stamp_ns=s.stamp_ns - start_ns) for s in late_scans))


def ends(at_s: float, run: Run) -> Run:
    """The source dies."""
    return replace(run, scans=tuple(s for s in run.scans if s.stamp_ns < 1e9 * at_s))


def at_rate(rate_hz: float, run: Run) -> Run:
    """Sampled at another rate."""
    from support.graph.spoilt_source import sampled

    return replace(run, scans=tuple(sampled(list(run.scans), rate_hz)))


WIRINGS: dict[str, tuple[str, Wiring]] = {
    "a load cell with its sign turned": (
        "load_force: its sign is turned", partial(scaled, "load_force", -1.0)
    ),
    "a load cell 200 ms late": (
        "load_force: it comes 200 ms late", partial(late, "load_force", 20)
    ),
    "a load cell with 25.4 times its scale": (
        "load_force: it reads 25.4", partial(scaled, "load_force", 25.4)
    ),
    "newtons as millinewtons": (
        "load_force: it reads 1000 times", partial(scaled, "load_force", 1000.0)
    ),
    "a command with its sign turned": (
        "commanded_voltage: its sign is turned", partial(scaled, "commanded_voltage", -1.0)
    ),
    "a command cut off": (
        "commanded_voltage: it is cut off", partial(cut_off, "commanded_voltage", 0.6)
    ),
    "a position 50 ms late": (
        "actuator_position: it comes 50 ms late", partial(late, "actuator_position", 5)
    ),
    "revolutions a minute as rad/s": (
        "motor_speed: it reads 9.55", partial(scaled, "motor_speed", 30.0 / math.pi)
    ),
    "positions swapped": (
        "actuator_position and load_position are swapped",
        partial(swapped, "actuator_position", "load_position"),
    ),
}  # fmt: skip
"""What is wired wrong on a healthy stand: its words, and what it does to a run."""
PAIRS = {"a load cell with its sign turned": {"jam"}}
"""Faults that explain the same readings: a load that always stands against the motion is a drag."""


def last_of(what: str) -> Outcome:
    """How it ends."""
    return Outcome.INDISTINGUISHABLE if what in PAIRS else Outcome.DATA_UNUSABLE


ROWS: dict[str, Row] = {
    "one load in 33 is missing": Row(
        HEALTHY, BLIND, Outcome.NOMINAL, change=partial(missing, "load_force", 33)
    ),
    "5 % of all readings are missing": Row(
        HEALTHY, BLIND, Outcome.NOMINAL, change=partial(missing_at_random, 0.05)
    ),
    "30 % of all readings are missing": Row(
        HEALTHY, BLIND, Outcome.NOMINAL, "parity_speed", change=partial(missing_at_random, 0.3)
    ),
    **{
        f"{words}, and the screw jams": Row(
            JAM, {*FOUND, *BLIND}, Outcome.INDISTINGUISHABLE, "jam", change=change
        )
        for words, change in {
            "one load in 33 is missing": partial(missing, "load_force", 33),
            "a load cell at 50 Hz": partial(missing, "load_force", 2),
            "10 % of all readings are missing": partial(missing_at_random, 0.1),
        }.items()
    },
    "newtons as millinewtons, and the screw jams": Row(
        JAM, BLIND, Outcome.DATA_UNUSABLE, "load_force",
        change=partial(in_another_unit, "load_force", 1000.0),
    ),
    "a load cell at 50 Hz": Row(
        HEALTHY, BLIND, Outcome.NOMINAL, change=partial(missing, "load_force", 2)
    ),
    "10 of 32 scans are lost": Row(
        HEALTHY, BLIND, Outcome.DATA_UNUSABLE, spoilt=("lost_regularly",)
    ),
    "each 20th scan is empty": Row(HEALTHY, BLIND, Outcome.NOMINAL, spoilt=("empty_scans",)),
    **{
        f"scans at {rate_hz:g} Hz": Row(
            HEALTHY, {Outcome.MODEL_MISMATCH, *QUIET}, Outcome.MODEL_MISMATCH, f"{rate_hz:g} Hz",
            change=partial(at_rate, rate_hz),
        )
        for rate_hz in (50.0, 80.0, 95.0, 99.0, 105.0, 120.0)
    },
    "stamps jitter": Row(HEALTHY, QUIET, Outcome.NOMINAL, spoilt=("jitter",)),
    "the clock steps back": Row(HEALTHY, QUIET, Outcome.NOMINAL, spoilt=("clock_set_back",)),
    "the clock steps back, and the screw jams": Row(
        JAM, {*FOUND, *QUIET},
        Outcome.INDISTINGUISHABLE, "jam", spoilt=("clock_set_back",),
    ),
    "another stand 5 ms beside": Row(HEALTHY, QUIET, Outcome.NOMINAL, beside=(JAM, 5_000_000)),
    "another stand once the first is dead": Row(
        HEALTHY, QUIET, Outcome.NOMINAL, beside=(HEALTHY + 1, 7_000_000), change=partial(ends, 6.0)
    ),
    "a bag of 2010 beside the stand": Row(HEALTHY, QUIET, Outcome.NOMINAL, troubles=("old_bag",)),
    **{
        what: Row(HEALTHY, {*UNKNOWN, last_of(what)}, last_of(what), words,
                  change=partial(rewired, change))
        for what, (words, change) in WIRINGS.items()
    },
    "a jam from the first scan on": Row(
        JAM, {Outcome.DETECTED, Outcome.ISOLATED, Outcome.INDISTINGUISHABLE, *QUIET},
        Outcome.INDISTINGUISHABLE, "jam", change=with_it_from_the_start,
    ),
    "through its life cycle again": Row(
        HEALTHY, QUIET, Outcome.NOMINAL, troubles=("configured_again",)
    ),
}  # fmt: skip


def world_of(row: Row, folder: Path) -> World:
    """A graph with the diagnoser in one process, and nothing but what the row says."""
    scheduler = Scheduler(5)
    run = run_of(row.unit, LENGTH_S)
    run = row.change(run) if row.change is not None else run
    disk = FailingDisk(folder, lambda _number, _name: 0)
    world = World(
        5, folder, run, scheduler, Network(scheduler), disk, row.spoilt, row.troubles,
        layout=(diagnoser,),
    )  # fmt: skip
    with scheduler.as_time():
        world.start()
        if row.beside is not None:
            unit, late_ns = row.beside
            world.beside("other_stand", run_of(unit, LENGTH_S), late_ns)
        world.finish()
    return world


def verdicts(world: World) -> list[AmbiguityGroup]:
    """What was said, in order."""
    return [decode(AmbiguityGroup, data) for _, topic, data in world.said
            if topic == "/ambiguity_group"]  # fmt: skip


OF_EACH_KIND = (
    "one load in 33 is missing", "newtons as millinewtons, and the screw jams", "scans at 99 Hz",
    "a load cell 200 ms late", "a load cell with its sign turned",
)  # fmt: skip
"""Rows of spoilt scans that go through a live graph all the same."""
LIVE = [name for name, row in ROWS.items()
        if name in OF_EACH_KIND or row.spoilt or row.troubles or row.beside]  # fmt: skip


def replayed(records: Sequence[Record]) -> list[AmbiguityGroup]:
    """Verdicts of a replay."""
    said = replay.diagnosed(in_blocks(records), make_pipeline(load_stand()))
    return [record for record in said if isinstance(record, AmbiguityGroup)]


@pytest.mark.parametrize("name", in_turn([name for name in ROWS if name not in LIVE]))
def test_the_right_answer_replayed(name: str) -> None:
    row = ROWS[name]
    run = row.change(run_of(row.unit, LENGTH_S))
    said = replayed([run.table, *run.scans])
    assert {v.outcome for v in said} <= row.allowed, [v.words[:120] for v in said]
    assert said[-1].outcome is row.last, said[-1].words
    assert row.words in said[-1].words


@pytest.mark.parametrize("name", in_turn(LIVE, 2))
def test_the_right_answer_live_and_replayed(name: str, tmp_path: Path) -> None:
    row = ROWS[name]
    said = verdicts(world_of(row, tmp_path))
    assert {v.outcome for v in said} <= row.allowed, [v.words[:120] for v in said]
    last = [v for v in said if not v.stale][-1]
    assert last.outcome is row.last, last.words
    assert row.words in last.words
    again = replayed([r for _, r in read_bag(tmp_path / "bag_0", [ChannelTable, Scan])])
    assert {v.outcome for v in again} <= row.allowed
    assert again[-1].outcome is row.last, again[-1].words


@pytest.mark.parametrize(
    "name", in_turn(["a load cell with its sign turned", "a command cut off",
                     "a position 50 ms late", "revolutions a minute as rad/s",
                     "positions swapped"], 2)
)  # fmt: skip
def test_the_evidence_names_the_wiring_too(name: str) -> None:
    words, change = WIRINGS[name]
    run = rewired(change, run_of(HEALTHY, LENGTH_S))
    pipeline = make_pipeline(load_stand(), configuration="evidence")
    said = [r for r in replay.diagnosed(in_blocks([run.table, *run.scans]), pipeline)
            if isinstance(r, AmbiguityGroup)]  # fmt: skip
    assert {v.outcome for v in said[:-1]} <= UNKNOWN
    assert said[-1].outcome is last_of(name)
    assert words in said[-1].words
    assert {member.fault for member in said[-1].members} == PAIRS.get(name, set())
