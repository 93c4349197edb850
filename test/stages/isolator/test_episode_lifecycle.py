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

"""When an episode of the isolator begins, joins the observer's, and ends."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache

import pytest

from flea_diag.configuration import knowledge as of_stand
from flea_diag.configuration.calibrations import learned
from flea_diag.configuration.stand import load_stand
from flea_diag.core.likelihood.fit import Fit, KnownErrors
from flea_diag.core.vibration.vibration_monitor import VibrationAlarm
from flea_diag.stages.isolator.episode_lifecycle import Change, EpisodeLifecycle
from flea_diag.stages.isolator.likelihood_method import LikelihoodMethod
from flea_diag.stages.isolator.parameters import IsolatorParameters, Knowledge
from flea_diag.stages.isolator.stand_status import StandStatus
from flea_diag.stages.merge import Merge
from flea_diag.stages.recurrence.recurrence_watch import ComesAndGoes
from flea_diag.wire.records import (
    ANOTHER_UNIT,
    TAKEN_BACK,
    TAKEN_OVER,
    Detection,
    Recurrence,
    Residual,
    Symbol,
    Symbols,
)

S = 1_000_000_000
SHIFT = "mean of 400 samples, 0.4 V above its earlier level"
ALARM = VibrationAlarm("accelerometer_2_x", "kurtosis", "+", "accelerometer_2_x: kurtosis 9")


@lru_cache(maxsize=1)
def knowledge() -> Knowledge:
    """Of the simulated stand."""
    return of_stand.knowledge(load_stand(), learned(load_stand()))


def lifecycle() -> EpisodeLifecycle:
    known, merge = knowledge(), Merge(Residual, S // 5, 2 * S)
    stand = StandStatus(known.calibration.counts, known.effects.residuals)
    method = LikelihoodMethod(known, IsolatorParameters(), stand)
    return EpisodeLifecycle(known.features, method, merge)


def opened(number: int, test: str = "mean of 50 samples") -> Detection:
    return Detection(number * S, number, True, "parity_electrical", 9.0, 5.0, test)


def closed(number: int, why: str = "quiet") -> Detection:
    return Detection(number * S + S // 2, number, False, "", 0.0, 0.0, why)


def symbols(number: int) -> Symbols:
    return Symbols(number * S, number, (Symbol("parity_electrical", "+", "?", number * S),))


def test_episodes_are_numbered_by_the_isolator_and_joined_by_the_observers_number() -> None:
    episodes = lifecycle()
    numbers = []
    for number in (4, 9):
        assert episodes.take(opened(number)) is Change.OPENED
        assert episodes.current is not None
        shared = episodes.current.shared
        numbers.append((shared.number, shared.detection_number, shared.detected_ns))
        assert episodes.take(closed(number)) is Change.CLOSED
        assert episodes.current is None
    assert numbers == [(1, 4, 4 * S), (2, 9, 9 * S)]


@pytest.mark.parametrize(
    ("record", "change"),
    [
        (opened(2), Change.NOTHING),
        (opened(2, TAKEN_OVER), Change.TAKEN_OVER),
        (closed(2), Change.CLOSED),
        (closed(2, ANOTHER_UNIT), Change.ANOTHER_UNIT),
        (closed(2, f"{TAKEN_BACK}: why"), Change.TAKEN_BACK),
    ],
)
def test_what_a_detection_changes_of_an_open_episode(record: Detection, change: Change) -> None:
    episodes = lifecycle()
    episodes.take(opened(1))
    assert episodes.take(record) is change
    ends = change in (Change.CLOSED, Change.ANOTHER_UNIT, Change.TAKEN_BACK)
    assert (episodes.current is None) is ends
    if change is Change.TAKEN_OVER:
        assert episodes.current is not None
        assert episodes.current.shared.taken_over


@pytest.mark.parametrize("why", ["quiet", ANOTHER_UNIT])
def test_what_comes_and_goes_is_not_over_between_two_times(why: str) -> None:
    """It was ahead of all that stays, another unit among it."""
    episodes = lifecycle()
    episodes.take(opened(1))
    told = Recurrence(5, S, 2 * S, 0.5, 0.5, 0.1, math.nan, math.nan, "m", 0.0, 5)
    fits = {"winding_open": Fit("winding_open", 90.0, (1.0,), KnownErrors((0.1,)))}
    episodes.recur(2 * S, ComesAndGoes(fits, told))
    numbers = []
    for record in (closed(1, why), opened(2), closed(2, why)):
        assert episodes.take(record) is Change.NOTHING
        numbers.append(episodes.current.shared.number if episodes.current else 0)
    episodes.recur(3 * S, ComesAndGoes({}, told))
    assert (numbers, episodes.current) == ([1, 1, 1], None)


def test_without_an_open_episode_nothing_is_closed_but_a_unit_may_be_exchanged() -> None:
    episodes = lifecycle()
    assert episodes.take(closed(1)) is Change.NOTHING
    assert episodes.take(closed(1, ANOTHER_UNIT)) is Change.ANOTHER_UNIT


def test_symbols_of_an_earlier_detection_are_not_of_the_open_episode() -> None:
    episodes = lifecycle()
    episodes.take(opened(3))
    assert episodes.of(symbols(2)) is None
    assert episodes.of(symbols(3)) is episodes.current


def test_symbols_that_come_before_their_detection_wait_for_it_once() -> None:
    episodes = lifecycle()
    assert episodes.of(symbols(3)) is None
    episodes.take(opened(3))
    assert episodes.early_symbols(opened(3)) == symbols(3)
    assert episodes.early_symbols(opened(3)) is None


def test_vibration_opens_an_episode_of_the_faults_that_vibrate_and_the_observer_joins_it() -> None:
    episodes = lifecycle()
    episode = episodes.open_by_vibration(2 * S, ALARM)
    vibrating = {name for name, fault in knowledge().faults.items() if fault.vibration}
    assert set(episode.names()) <= vibrating
    assert "spall" in episode.names()
    assert episode.is_vibration_only
    assert (episode.shared.number, episode.shared.detection_number) == (1, 0)
    assert episodes.take(opened(4, SHIFT)) is Change.NOTHING
    assert (episode.shared.number, episode.shared.detection_number) == (1, 4)
    assert episode.shared.opening_shift == "parity_electrical"
    assert not episode.is_vibration_only
    # What only left its own level of the run is not held against what vibration opened.
    before = episode.names()
    episode.observe(symbols(4), ())
    assert (episode.symbols, episode.names()) == ((), before)


def test_what_began_after_vibration_opened_an_episode_is_another_one() -> None:
    """Its features spoke before the fault was there."""
    for onset_ns, change, number in ((S, Change.NOTHING, 1), (3 * S, Change.OPENED, 2)):
        episodes = lifecycle()
        episodes.open_by_vibration(2 * S, ALARM)
        found = replace(opened(4), onsets=(("1", onset_ns), ("2", 3 * S)))
        assert episodes.take(found) is change
        assert episodes.current is not None
        assert episodes.current.shared.number == number
        assert episodes.current.shared.opened_by_vibration is (number == 1)


@pytest.mark.parametrize(
    ("residual", "yields"), [("parity_electrical", True), ("nut_temperature", False)]
)
def test_an_episode_of_the_circuit_alone_yields_to_vibration(residual: str, yields: bool) -> None:
    episodes = lifecycle()
    episodes.take(Detection(S, 1, True, residual, 9.0, 5.0, SHIFT))
    first = episodes.current
    assert first is not None
    assert first.yields_to_vibration is yields
    second = episodes.open_by_vibration(2 * S, ALARM)
    assert (second.shared.number, second.shared.detection_number) == (2, 1)
    assert second.shared.opening_shift == residual
    assert not second.yields_to_vibration
