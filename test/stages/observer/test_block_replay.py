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

"""Quiet scans in blocks, and the way back where something happens in one."""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from support import stands
from support.observer_scans import jammed

from flea_diag.configuration.knowledge import effects
from flea_diag.configuration.stand import load_stand
from flea_diag.core.state_copy import state_copy
from flea_diag.stages.observer import block_replay
from flea_diag.stages.observer.block_replay import (
    LEAST_SCANS,
    MOST_BLOCKS,
    MOST_REPEATED,
    MOST_SCANS,
    QUIET_SHARE,
    WORTH_SCANS,
    BlockReplay,
    Checkpoint,
)
from flea_diag.stages.observer.observer_chain import ObserverChain
from flea_diag.stages.observer.observer_parameters import ObserverParameters
from flea_diag.wire.blocks import ScanBlock
from flea_diag.wire.records import Detection

START = 700
"""The warm-up is over."""
LOAD_N = 1000.0
"""Far outside the calibration."""
NEVER = 10**6


def block(start: int, stop: int, loaded: int = NEVER) -> ScanBlock:
    """Scans of the run, with so much more load from the scan ``loaded`` on."""
    scans = jammed()[start:stop]
    rows = np.array([scan.values for scan in scans])
    rows[max(loaded - start, 0) :, scans[0].channels.index("load_force")] += LOAD_N
    return ScanBlock(np.array([scan.stamp_ns for scan in scans]), scans[0].channels, rows)


@cache
def detected_at() -> int:
    """Number of the scan that opens the episode, scans taken singly."""
    found = stands.feed(stands.observer(state_observer="none"), jammed())
    (detection,) = stands.of(Detection, found)
    return next(k for k, scan in enumerate(jammed()) if scan.stamp_ns == detection.stamp_ns)


def warm() -> ObserverChain:
    """A chain after its warm-up, which ends with a single scan."""
    parameters = ObserverParameters(state_observer="none")
    known = stands.calibration()
    chain = ObserverChain(known, effects(load_stand(), known), parameters)
    chain.begin(jammed()[0].stamp_ns, None)
    for k in range(START):
        one = block(k, k + 1)
        chain.order.step(int(one.stamps_ns[0]))
        readings = chain.channels.read(one)
        chain.other_unit(readings)
        _, output = chain.examine(one, readings)
        chain.episode.step(int(one.stamps_ns[0]), output.results)
    chain.order.say(jammed()[START - 1].stamp_ns)
    return chain


def test_what_a_stream_needs_is_built_before_its_first_scan_and_anew_for_the_next_stream():
    known = stands.calibration()
    chain = ObserverChain(known, effects(load_stand(), known), ObserverParameters())
    first = chain.stream
    chain.begin(jammed()[0].stamp_ns, None)
    assert chain.stream is first
    chain.begin(jammed()[1].stamp_ns, None)
    assert chain.stream is not first


@pytest.mark.slow
@pytest.mark.parametrize("after", [NEVER, 5], ids=["nothing follows", "an abstention follows"])
def test_blocks_grow_while_quiet_and_stop_before_the_scan_of_the_detection(after: int):
    """Even where the relation that shows it is void at the end of the same block."""
    event, chain, replay = detected_at(), warm(), BlockReplay()
    at, taken = START, []
    while at < event:
        chain, quiet, output = replay.take(chain, block(at, len(jammed()), event + after))
        if output is None:
            break
        assert len(output.residuals) == quiet
        taken.append(quiet)
        at += quiet
    assert at == event
    assert taken[0] == LEAST_SCANS
    assert all(later == 2 * earlier for earlier, later in pairwise(taken[:-1]))
    # Left as if nothing had been tried: the next scan is the event, and no block takes it.
    assert chain.order.last_ns == jammed()[event - 1].stamp_ns
    assert not chain.episode.is_open
    assert replay.take(chain, block(event, len(jammed()), event + after))[1] == 0


@pytest.mark.slow
def test_live_blocks_of_a_few_scans_leave_little_to_repeat_after_an_event():
    event, chain, replay, few = detected_at(), warm(), BlockReplay(), 3
    at, kept = START, []
    while True:
        chain, quiet, _ = replay.take(chain, block(at, at + few))
        at += quiet
        if quiet < few:
            break
        kept.append(len(replay._checkpoint.blocks))
    assert at == event
    assert len(kept) > MOST_BLOCKS == max(kept)
    assert chain.order.last_ns == jammed()[event - 1].stamp_ns


@pytest.mark.slow
def test_the_state_is_not_copied_for_each_scan_where_others_come_between(monkeypatch):
    """As with another source on the same topic."""
    copies, stage, count = [], stands.observer(state_observer="none"), 10 * WORTH_SCANS
    stands.feed(stage, jammed()[:START])
    monkeypatch.setattr(
        block_replay, "state_copy", lambda chain: copies.append(chain) or state_copy(chain)
    )
    for at in range(START, START + count):
        taken, _ = stage.handle_block(block(at, at + 1))
        stage.handle(jammed()[at])  # alone, or once more, which is passed over
        assert taken in (0, 1)
    assert 0 < len(copies) <= count // WORTH_SCANS


def test_what_came_in_small_blocks_is_repeated_as_one(monkeypatch):
    chain, few, calls = warm(), 5, []
    checkpoint = Checkpoint(state_copy(chain))
    for at in range(START, START + 20 * few, few):
        chain.follow(block(at, at + few))
        checkpoint.take(block(at, at + few))
    follow = ObserverChain.follow
    monkeypatch.setattr(
        ObserverChain, "follow", lambda self, part: calls.append(len(part)) or follow(self, part)
    )
    again = checkpoint.restored()
    assert calls == [20 * few]
    monkeypatch.undo()
    coming = block(START + 20 * few, START + 21 * few)
    (_, expected), (_, found) = chain.follow(coming), again.follow(coming)
    assert found.regressors.tobytes() == expected.regressors.tobytes()
    assert found.results.table.tobytes() == expected.results.table.tobytes()


def test_the_longer_it_was_quiet_the_more_may_be_repeated_up_to_a_limit(monkeypatch):
    chain, replay, copies = warm(), BlockReplay(), []
    monkeypatch.setattr(block_replay, "state_copy", lambda state: copies.append(taken) or state)
    monkeypatch.setattr(ObserverChain, "leading", lambda self, part: len(part))
    monkeypatch.setattr(ObserverChain, "follow", lambda self, part: (len(part), None))
    taken, part = 0, block(START, START + LEAST_SCANS)
    many = ScanBlock(*(np.resize(a, (4 * MOST_SCANS, *a.shape[1:])) if isinstance(a, np.ndarray)
                       else a for a in (part.stamps_ns, part.channels, part.values)))  # fmt: skip
    while taken < 20 * MOST_REPEATED:
        chain, quiet, _ = replay.take(chain, many)
        taken += quiet
    between = np.diff(copies)
    assert between[0] >= MOST_SCANS
    assert all(now <= later for now, later in pairwise(between[1:]))
    assert between[-1] == MOST_REPEATED
    begun = np.array(copies[1:-1])
    assert (between[1:] <= np.maximum(begun / QUIET_SHARE, MOST_SCANS) + MOST_SCANS).all()
