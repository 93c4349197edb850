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

"""Any partition of a recording into blocks gives the records of its scans one by one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache
from itertools import groupby

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from support import examples, stand_runs, stands
from support.decisions import BAGS
from support.models import linear_ema as ema

from flea_diag.configuration.component import make_pipeline
from flea_diag.configuration.knowledge import effects
from flea_diag.configuration.stand import load_stand
from flea_diag.stages.digest import digest
from flea_diag.stages.extractor.extractor import ExtractorStage
from flea_diag.stages.isolator.isolator import IsolatorParameters, IsolatorStage
from flea_diag.stages.observer.observer import ObserverStage
from flea_diag.stages.observer.observer_parameters import ObserverParameters
from flea_diag.stages.pipeline import Pipeline
from flea_diag.tools.evaluate.baselines import Setting, baseline
from flea_diag.wire.bags.bag import BagReader
from flea_diag.wire.blocks import ResidualBlock, ScanBlock
from flea_diag.wire.records import (
    AmbiguityGroup,
    ChannelTable,
    DataQuality,
    Detection,
    FeatureRequest,
    FeatureValue,
    Record,
    Scan,
    VibrationBlock,
    VibrationLevel,
)

pytestmark = pytest.mark.slow

CHANNELS = ema.STAND
RUNS = {
    "healthy": ({}, 99.0),
    "jam": ({"coulomb": 200.0, "viscous": 1500.0}, 8.0),
    "rest": ({}, 99.0),
    "turned": ({}, 99.0),
}


@lru_cache(maxsize=4)
def recording(name: str) -> tuple[Scan, ...]:
    changes, onset_s = RUNS[name]
    motion = {"reference": lambda t: 0.0} if name == "rest" else {}
    columns = ema.run(seconds=12.0, faulty=ema.changed(**changes), onset_s=onset_s, **motion)
    scans = stands.scans(ema.noisy(columns, 60))
    if name == "turned":
        scans = turned(scans, "load_force")
    return tuple(scans)


def turned(scans: list[Scan], channel: str) -> list[Scan]:
    """One channel with its sign turned."""
    column, out = CHANNELS.index(channel), []
    for scan in scans:
        values = list(scan.values)
        values[column] *= -1.0
        out.append(replace(scan, values=tuple(values)))
    return out


def pipeline(kind: str = "none") -> Pipeline:
    """All three stages; quick to arm again, so that episodes close within a test."""
    calibration = stands.calibration()
    parameters = ObserverParameters(rearm_after_s=2.0, warm_up_s=4.0, state_observer=kind)
    known = stands.knowledge()
    return Pipeline(
        (
            ObserverStage(calibration, effects(load_stand(), calibration), parameters),
            IsolatorStage(known, IsolatorParameters()),
            ExtractorStage(known.features),
        )
    )


def block_of(scans: list[Scan]) -> ScanBlock:
    stamps_ns = np.array([scan.stamp_ns for scan in scans], dtype=np.int64)
    return ScanBlock(stamps_ns, scans[0].channels, np.array([scan.values for scan in scans]))


def flat(records) -> Iterator[Record]:
    for record in records:
        if isinstance(record, ResidualBlock):
            yield from record.records()
        else:
            yield record


def by_topic(records) -> dict[str, list[str]]:
    """Records of each topic in their order; ``repr`` makes NaN equal to itself."""
    found: dict[str, list[str]] = {}
    for record in records:
        if isinstance(record, FeatureValue):
            record = replace(record, cost_ms=0.0)  # measured
        found.setdefault(type(record).__name__, []).append(repr(record))
    return found


def singly(scans: list[Scan], kind: str = "none") -> list[Record]:
    return stands.feed(pipeline(kind), [stands.table(), *scans])


def in_blocks(scans: list[Scan], lengths: list[int], kind: str = "none") -> list[Record]:
    """Blocks of these lengths, over and over."""
    stage = pipeline(kind)
    out = list(stage.handle(stands.table()))
    start, turn = 0, 0
    while start < len(scans):
        part = scans[start : start + lengths[turn % len(lengths)]]
        out += flat(stage.handle_block(block_of(part)))
        start, turn = start + len(part), turn + 1
    return out + list(stage.finish())


def spoilt(scans: tuple[Scan, ...], faults: list[tuple[str, int, int, float]]) -> list[Scan]:
    """Faults of the plumbing and of sensors, each from a scan on for so many scans."""
    out = list(scans)
    for kind, at, count, size in faults:
        rows = range(at, min(at + count, len(out)))
        if kind == "gap":
            del out[at : at + count]
        elif kind == "twice":
            out[at:at] = [replace(out[at], values=(9.0,) * len(CHANNELS))]
        elif kind == "late":
            out.insert(at, out[at - count % 40])
        elif kind == "back":
            shift = 3_000_000_000
            out[at:] = [replace(s, stamp_ns=s.stamp_ns - shift) for s in out[at:]]
        elif kind == "sparse":
            draw = np.random.default_rng(count)
            for row in rows:
                values = np.array(out[row].values)
                values[draw.random(len(values)) < 0.1] = np.nan
                values[row % 2 :: 4] = np.nan
                out[row] = replace(out[row], values=tuple(values.tolist()))
        else:
            column = CHANNELS.index(kind)
            for row in rows:
                values = list(out[row].values)
                values[column] = size if abs(size) > 1e3 else values[column] + size
                out[row] = replace(out[row], values=tuple(values))
    return out


FAULTS = st.tuples(
    st.sampled_from(("gap", "twice", "late", "back", "sparse", *CHANNELS)),
    st.integers(50, 1000),
    st.integers(1, 300),
    st.sampled_from((float("nan"), 0.6, -8.0, 1e6)),
)


@pytest.mark.in_turn(2)
@example("jam", [("sparse", 50, 1100, 0.0)], [400, 7, 61])
@example("healthy", [("back", 403, 1, float("nan"))], [203])  # back into the warm-up just over
@example("turned", [], [203])
@example("turned", [("gap", 900, 100, float("nan"))], [1, 977])
@settings(max_examples=examples(12), deadline=None)
@given(
    st.sampled_from(sorted(RUNS)),
    st.lists(FAULTS, max_size=3),
    st.lists(st.integers(1, 1500), min_size=1, max_size=6),
)
def test_any_partition_gives_the_same_records(run, faults, lengths):
    scans = spoilt(recording(run), faults)
    one, many = singly(scans), in_blocks(scans, lengths)
    assert by_topic(one) == by_topic(many)
    assert digest(one) == digest(many)


@pytest.mark.in_turn(2)
@pytest.mark.parametrize("kind", ["kalman", "particle"])
def test_a_state_observer_sees_the_same_in_blocks(kind):
    scans = list(recording("jam"))[:1100]
    one, many = singly(scans, kind), in_blocks(scans, [400, 37], kind)
    assert by_topic(one) == by_topic(many)
    assert stands.of(Detection, one)


def test_the_recordings_show_what_is_to_be_held_equal():
    """The property above is not empty: all kinds of records occur, and blocks are taken."""
    out = singly(spoilt(recording("jam"), [("load_force", 300, 80, float("nan"))]))
    assert {Detection, AmbiguityGroup, DataQuality} <= {type(record) for record in out}
    assert len(stands.of(DataQuality, out)) > 2
    stage = pipeline()
    stage.handle(stands.table())
    made = stage.handle_block(block_of(list(recording("healthy"))))
    blocks = [record for record in made if isinstance(record, ResidualBlock)]
    assert sum(map(len, blocks)) > 0.9 * len(recording("healthy"))


@pytest.mark.in_turn(2)
@pytest.mark.parametrize("configuration", ["hybrid", "evidence"])
def test_vibration_between_the_scans_changes_nothing(configuration):
    """Residuals go one by one to an isolator that listens to levels; the rest is as before."""
    bag = BagReader(BAGS / "jam")
    source = [record for _, record in bag.records((ChannelTable, VibrationBlock, Scan))]
    made = baseline(configuration).make
    one = stands.feed(made(Setting(load_stand())), source)
    stage, many = made(Setting(load_stand())), []
    for is_scan, part in groupby(source, key=lambda record: isinstance(record, Scan)):
        if is_scan:
            many += flat(stage.handle_block(block_of(list(part))))
        else:
            many += [caused for record in part for caused in stage.handle(record)]
    many += stage.finish()
    assert by_topic(one) == by_topic(many)
    assert {VibrationLevel, FeatureRequest, FeatureValue} <= {type(record) for record in one}


@pytest.mark.parametrize("in_blocks", [False, True])
def test_a_level_that_begins_anew_in_an_episode_is_frozen_by_no_scan(in_blocks: bool) -> None:
    """A load cell is silent for 1.5 s after a resistance has risen: its balance begins anew."""
    rises = {"fault": "winding_resistance_rise", "onset_s": 25.0, "size": 0.6}
    run = stand_runs.records(duration_s=50.0, seed=5, faults=[rises])
    sent = [record for record in run if isinstance(record, Scan)]
    sent[4000:4150] = [blank(scan, "load_force") for scan in sent[4000:4150]]
    pipeline = make_pipeline(load_stand())
    say = stands.said_in_blocks if in_blocks else stands.feed
    assert any(r.detected for r in stands.of(Detection, say(pipeline, sent)))
    stream = pipeline._stages[0]._chain.stream
    frozen = stream._tests._mean_shift._level._is_frozen
    assert frozen.any()
    assert not frozen.all()


def blank(scan: Scan, channel: str) -> Scan:
    """A scan without the reading of this channel."""
    pairs = zip(scan.channels, scan.values, strict=True)
    return replace(scan, values=tuple(np.nan if c == channel else v for c, v in pairs))
