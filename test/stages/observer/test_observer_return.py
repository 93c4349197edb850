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

"""An observer that is killed and comes back in mid-run: it takes over what the verdict keeps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from support import stands
from support.models import linear_ema as ema

from flea_diag.configuration.component import DIAGNOSER, EXTRACTOR, ISOLATOR, OBSERVER
from flea_diag.stages.isolator.isolator import IsolatorStage
from flea_diag.stages.pipeline import Pipeline
from flea_diag.wire.records import (
    TAKEN_OVER,
    AmbiguityGroup,
    DataQuality,
    Detection,
    Outcome,
    Record,
    Residual,
    Scan,
    VibrationBlock,
)
from flea_sim_driver.scenario.scenario_file import scenario_from_mapping
from flea_sim_driver.stand import SimulatedStand

pytestmark = pytest.mark.slow

S = 1_000_000_000
AWAY = 150
"""Scans that arrive while no observer runs."""
ALONE = 100
"""Scans that come one by one to an observer that is back; those after them come in blocks."""


@lru_cache(maxsize=1)
def healthy() -> ema.Columns:
    return ema.noisy(ema.run(seconds=21.0), 71)


def faulty(channel: str, error: Callable[[np.ndarray], np.ndarray], onset: int) -> list[Scan]:
    wrong = healthy()[channel].copy()
    wrong[onset:] = error(wrong[onset:])
    return stands.scans({**healthy(), channel: wrong})


def jammed(onset: int) -> list[Scan]:
    worse = ema.changed(coulomb=200.0, viscous=1500.0)
    return stands.scans(ema.noisy(ema.run(seconds=21.0, faulty=worse, onset_s=onset / 100), 71))


class Stand:
    """An isolator that lives on, and observers that come and go."""

    def __init__(self) -> None:
        self.isolator: IsolatorStage = stands.isolator()
        self.said: list[Record] = []
        self.come()

    def come(self, *told: Record) -> None:
        """A fresh observer, which is told what is latched."""
        self.pipeline = Pipeline((stands.observer(), self.isolator))
        for record in (stands.table(), *told):
            self.said += self.pipeline.handle(record)

    def run(self, scans: list[Scan]) -> None:
        """Before anybody falls."""
        self.said += stands.said_in_blocks(self.pipeline, scans)

    def go_on(self, scans: list[Scan]) -> None:
        """After somebody has come back: scan by scan until all are connected, as from a stand."""
        for scan in scans[:ALONE]:
            self.said += self.pipeline.handle(scan)
        self.run(scans[ALONE:])

    @property
    def verdict(self) -> AmbiguityGroup:
        return stands.verdict(self.said)


def returned(scans: list[Scan], killed: int) -> Stand:
    """The stand after an observer was away for a while in mid-run."""
    stand = Stand()
    stand.run(scans[:killed])
    stand.come(stand.verdict)
    stand.said.clear()
    stand.go_on(scans[killed + AWAY :])
    stand.said += stand.pipeline.finish()
    return stand


FAULTS = {
    "jam": lambda: jammed(1000),
    "motor_current_bias": lambda: faulty("motor_current", lambda y: y + 0.6, 1000),
    "motor_temperature_bias": lambda: faulty("motor_temperature", lambda y: y + 15.0, 1000),
    "load_force_bias": lambda: faulty("load_force", lambda y: y + 100.0, 1000),
}


@pytest.mark.parametrize(
    ("fault", "killed"),
    [
        ("jam", 1300),  # while the group still shrinks
        ("motor_current_bias", 1300),
        ("motor_temperature_bias", 1300),
        ("motor_temperature_bias", 1700),  # once it is isolated
        ("load_force_bias", 1700),
    ],
)
def test_an_open_episode_is_taken_over_and_no_verdict_is_wrong(fault: str, killed: int) -> None:
    stand = returned(FAULTS[fault](), killed)
    groups = stands.of(AmbiguityGroup, stand.said)
    for group in groups:
        assert group.outcome is not Outcome.NOMINAL
        assert fault in stands.members(group)
        assert group.detected_stamp_ns < stands.START_NS + killed * stands.PERIOD_NS
    assert "observer restarted" in groups[-1].words
    (detection,) = stands.of(Detection, stand.said)
    assert (detection.detected, detection.test) == (True, TAKEN_OVER)


def test_a_table_that_comes_after_the_first_verdict_since_a_restart_is_in_time() -> None:
    """On a busy machine scans are connected first, and that they begin is a verdict by itself."""
    scans = FAULTS["motor_temperature_bias"]()
    stand = Stand()
    stand.run(scans[:1300])
    alone = Pipeline((stands.observer(), stands.isolator()))
    said = list(alone.handle(stand.verdict))
    for scan in scans[1300 + AWAY :][:ALONE]:
        said += alone.handle(scan)
    assert [group.episode for group in stands.of(AmbiguityGroup, said)] == [0]
    (detection,) = stands.of(Detection, list(alone.handle(stands.table())))
    assert (detection.detected, detection.test) == (True, TAKEN_OVER)


def test_without_the_verdict_the_fault_is_learned_away() -> None:
    """What all this is for: the same return, but nobody tells the observer."""
    late = FAULTS["motor_temperature_bias"]()[1700 + AWAY :]
    assert not stands.of(Detection, stands.replay(stands.observer(), [stands.table(), *late]))


def test_a_diagnosis_that_comes_late_says_from_when_on_it_watched() -> None:
    """Observer and isolator at once, as a `diagnoser` that was killed: nobody is left to tell."""
    late = FAULTS["motor_temperature_bias"]()[1700:]
    stand = Stand()
    stand.run(late)
    stand.said += stand.pipeline.finish()
    assert "observation began 17.00 s after stand start" in stand.verdict.words
    in_time = Stand()
    in_time.run(stands.scans(healthy())[100:900])
    assert "observation began" not in in_time.verdict.words


@pytest.mark.parametrize(
    ("fault", "killed"),
    [
        ("jam", 1300),
        ("motor_current_bias", 1020),  # before it is detected
        ("motor_current_bias", 1300),
        ("motor_temperature_bias", 1700),
        ("load_force_bias", 1700),
    ],
)
def test_a_verdict_that_was_kept_tells_both_of_them(fault: str, killed: int) -> None:
    """Observer and isolator at once, and the memory of their last verdict."""
    scans, stand = FAULTS[fault](), Stand()
    stand.run(scans[:killed])
    kept = stand.verdict
    stand.isolator = stands.isolator()
    stand.come(kept)
    stand.said.clear()
    stand.go_on(scans[killed + AWAY :])
    stand.said += stand.pipeline.finish()
    assert stand.verdict.offsets == kept.offsets != ()
    assert fault in stands.members(stand.verdict)
    groups = stands.of(AmbiguityGroup, stand.said)
    assert all(fault in stands.members(group) for group in groups if group.episode)
    if kept.episode:
        assert all(group.episode for group in groups)


def test_what_was_learned_of_the_unit_is_taken_over() -> None:
    first = Stand()
    scans = stands.scans(healthy())
    first.run(scans[:900])
    kept = first.verdict.offsets
    assert {offset.parameter for offset in kept} == {"current_offset_a", "voltage_offset_v"}
    stand = returned(scans, 900)
    assert stands.of(DataQuality, stand.said)[-1].offsets == kept
    assert stand.verdict.offsets == kept
    assert stand.verdict.outcome is Outcome.NOMINAL
    assert "observer restarted 10.50 s after the start" in stand.verdict.words
    assert not stands.of(Detection, stand.said)


def test_a_fault_that_begins_right_after_the_return_is_not_learned_away() -> None:
    """A bias in what would be the warm-up of an observer that knew nothing."""
    stand = returned(faulty("motor_current", lambda y: y + 0.6, 900 + AWAY), 900)
    assert stands.of(Detection, stand.said)
    assert "motor_current_bias" in stands.members(stand.verdict)


def test_only_a_reset_ends_an_episode_that_was_taken_over() -> None:
    stand = returned(FAULTS["motor_temperature_bias"](), 1700)
    assert "only ~/reset ends this episode" in stand.verdict.words
    stand.said += stand.pipeline.reset()
    assert stand.verdict.outcome is Outcome.NOMINAL


def test_another_run_inherits_nothing() -> None:
    """The stand was started again: its channel table is younger than what the verdict keeps."""
    stand = Stand()
    stand.run(FAULTS["jam"]()[:1700])
    kept = stand.verdict
    again = stands.observer()
    again.handle(replace(stands.table(), stamp_ns=stands.START_NS + 100 * S))
    again.handle(kept)
    later = stands.scans(healthy(), start_ns=stands.START_NS + 100 * S)
    said = stands.replay(again, later[:400])
    assert not stands.of(Detection, said)
    assert stands.of(DataQuality, said)[-1].offsets == ()


class Nobody:
    """In place of an observer that is away."""

    consumes: tuple[type, ...] = ()

    def handle(self, record: Record) -> tuple[Record, ...]:
        return ()


def at_rest(block: VibrationBlock) -> VibrationBlock:
    offsets, samples = block.points()
    return VibrationBlock.pack(block.stamp_ns, block.axes, offsets, 0.0 * samples)


def test_vibration_of_a_time_of_which_no_speed_is_known_is_not_judged() -> None:
    """The stand rests while the observer is away: levels that wait belong to no later speed."""
    values = DIAGNOSER.parameters()
    isolator, extractor = ISOLATOR.build(values), EXTRACTOR.build(values)
    watched = Pipeline((OBSERVER.build(values), isolator, extractor))
    blind = Pipeline((Nobody(), isolator, extractor))
    again = Pipeline((OBSERVER.build(values), isolator, extractor))
    stand = SimulatedStand(scenario_from_mapping({"duration_s": 14.0}, "nominal"))
    said: list[Record] = []
    for record in stand:
        away = 6.0 <= (record.stamp_ns - stand.start_ns) / S < 11.0
        if away and isinstance(record, VibrationBlock):
            record = at_rest(record)
        late = record.stamp_ns - stand.start_ns >= 11.0 * S
        said += (again if late else blind if away else watched).handle(record)
    assert not [group for group in stands.of(AmbiguityGroup, said) if group.episode]


def test_an_isolator_that_comes_back_after_the_observer_knows_that_an_episode_is_open() -> None:
    stand = returned(FAULTS["motor_temperature_bias"](), 1700)
    latched = [stands.of(DataQuality, stand.said)[-1], *stands.of(Detection, stand.said)]
    fresh = stands.isolator()
    later = [r for r in stand.said if isinstance(r, Residual)][-100:]
    groups = stands.of(AmbiguityGroup, stands.replay(fresh, [*latched, *later]))
    assert groups[0].outcome is Outcome.DETECTED
    assert "before observer and isolator restarted" in groups[0].words
    assert all(group.episode for group in groups)
