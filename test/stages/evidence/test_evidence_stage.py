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

"""One evidence on an actuator of few sensors: healthy, dragged, lying, and exchanged."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from support.models import linear_ema as ema
from support.models.linear_evidence import ONSET_S, STAND, block, diagnosis, running, table

from flea_diag.configuration.component import evidence_pipeline
from flea_diag.stages.isolator.parameters import IsolatorParameters
from flea_diag.stages.observer.observer_parameters import ObserverParameters
from flea_diag.stages.pipeline import Pipeline
from flea_diag.wire.blocks import ResidualBlock
from flea_diag.wire.records import (
    TAKEN_OVER,
    AmbiguityGroup,
    Detection,
    FeatureRequest,
    FeatureValue,
    Outcome,
    Record,
    Residual,
    Symbols,
)

pytestmark = pytest.mark.slow


def records(columns: ema.Columns, together: int = 2400) -> list[Record]:
    """What is said of a run, its scans so many at a time."""
    stage, whole = evidence_pipeline(diagnosis(), STAND), block(columns)
    said: list[Record] = list(stage.handle(table()))
    for first in range(0, len(whole), together):
        said += stage.handle_block(whole.part(slice(first, first + together)))
    return [record for record in said if isinstance(record, AmbiguityGroup | Detection)]


@cache
def dragged() -> tuple[Record, ...]:
    """All that is said of a run with more friction."""
    return tuple(said_by(begun(), running(coulomb=150.0)))


def groups(said: Sequence[Record]) -> Iterator[set[str]]:
    for record in said:
        if isinstance(record, AmbiguityGroup):
            yield {member.fault for member in record.members}


def lying(channel: str, change: Callable[[np.ndarray], np.ndarray]) -> ema.Columns:
    columns = dict(running())
    since = round(ONSET_S * 100)
    wrong = columns[channel].copy()
    wrong[since:] = change(wrong[since:])
    return {**columns, channel: wrong}


def test_a_healthy_run_that_the_law_does_not_know_is_quiet() -> None:
    said = records(running())
    assert not any(isinstance(record, Detection) for record in said)
    last = [record for record in said if isinstance(record, AmbiguityGroup)][-1]
    assert last.outcome is Outcome.NOMINAL


def test_more_friction_is_found_after_its_onset_and_its_group_only_shrinks() -> None:
    said = dragged()
    detection = next(r for r in said if isinstance(r, Detection))
    assert 0.0 < detection.stamp_ns / 1e9 - ONSET_S < 2.0
    assert abs(detection.z) > detection.threshold
    found = [group for group in groups(said) if group]
    assert {"jam"} <= found[-1] <= {"jam", "ball_nut_friction"}
    for earlier, later in pairwise(found):
        assert later <= earlier


@pytest.mark.in_turn(2)
@pytest.mark.parametrize(
    ("channel", "change", "fault"),
    [
        ("motor_current", lambda y: y + 0.8, "motor_current_bias"),
        ("motor_current", lambda y: 1.5 * y, "motor_current_scaling"),
        ("load_force", lambda y: y + 80.0, "load_force_bias"),
        ("motor_temperature", lambda y: 0.0 * y + 30.0, "motor_temperature_dead"),
    ],
)
def test_a_wrong_sensor_is_named(
    channel: str, change: Callable[[np.ndarray], np.ndarray], fault: str
) -> None:
    assert list(groups(records(lying(channel, change))))[-1] == {fault}


def test_a_load_that_no_sensor_feels_is_no_bias_of_the_load_cell() -> None:
    """The cell and what it does not feel are one in the balance, but only a bias is a jump."""

    def load(t: float) -> float:
        return 60.0 + 40.0 * math.sin(1.3 * t) + (150.0 if t >= ONSET_S else 0.0)

    columns = ema.noisy(ema.run(seconds=24.0, load=load), 60)
    columns["load_force"][round(ONSET_S * 100) :] -= 150.0
    last = [r for r in records(columns) if isinstance(r, AmbiguityGroup)][-1]
    assert (last.outcome, last.members) == (Outcome.UNEXPLAINED, ())
    (bias,) = (row for row in last.dropped if row.fault == "load_force_bias")
    assert "has jumped by" in bias.reason


def test_another_healthy_unit_is_said_and_is_no_fault() -> None:
    """All that units differ by at once, within the tolerances of the description."""
    said = records(
        running(coulomb=72.0, viscous=620.0, resistance=3.45, back_emf=174.0, current_offset=0.4,
                voltage_offset=-0.3)
    )  # fmt: skip
    assert all(not group for group in groups(said))
    last = [record for record in said if isinstance(record, AmbiguityGroup)][-1]
    assert "another unit" in last.words


@pytest.mark.in_turn(2)
def test_blocks_and_single_scans_give_the_same_verdicts() -> None:
    """Four seconds past the onset: the group is open and has shrunk."""
    columns = {name: values[:1300] for name, values in running(coulomb=150.0).items()}
    singly = records(columns, 1)
    assert singly == records(columns, 33) == records(columns)
    assert any(isinstance(record, Detection) for record in singly)
    assert len([group for group in groups(singly) if group]) > 1


def said_by(stage: Pipeline, columns: ema.Columns, first: int = 0) -> list[Record]:
    """All that is said of the scans of a run, the first of them at a stamp of its number."""
    said: list[Record] = []
    for record in stage.handle_block(block(columns, first)):
        said += record.records() if isinstance(record, ResidualBlock) else [record]
    return said


def begun(**parameters: float) -> Pipeline:
    """A diagnoser that has its channel table."""
    stage = evidence_pipeline(diagnosis(), STAND, **parameters)
    stage.handle(table())
    return stage


@cache
def passing() -> ema.Columns:
    """A load cell that is off from 9 s to 24 s of 80 s."""
    motion, mean = ema.MOTIONS[5]
    columns = ema.noisy(
        ema.run(ema.HEALTHY, 80.0, motion, lambda t: mean + 40.0 * math.sin(1.3 * t)), 91
    )
    wrong = columns["load_force"].copy()
    wrong[900:2400] += 80.0
    return {**columns, "load_force": wrong}


def test_an_episode_that_is_over_is_closed_and_does_not_open_again() -> None:
    said = said_by(begun(rearm_after_s=10.0), passing())
    flags = [record for record in said if isinstance(record, Detection)]
    assert [flag.detected for flag in flags] == [True, False]
    assert flags[1].test == "quiet"
    assert 24.0 + 10.0 <= flags[1].stamp_ns / 1e9 < 24.0 + 20.0
    last = [record for record in said if isinstance(record, AmbiguityGroup)][-1]
    assert last.outcome is Outcome.NOMINAL


@pytest.mark.in_turn(2)
def test_without_a_time_to_rearm_only_a_reset_ends_an_episode() -> None:
    stage = begun(rearm_after_s=0.0)
    first = {name: values[:6000] for name, values in passing().items()}
    said = said_by(stage, first)
    assert [record.detected for record in said if isinstance(record, Detection)] == [True]
    ended = [record for record in stage.reset() if isinstance(record, Detection | AmbiguityGroup)]
    assert [type(record) for record in ended] == [Detection, AmbiguityGroup]
    healthy = {name: values[6000:] for name, values in passing().items()}
    after = said_by(stage, healthy, 6000)
    assert not any(isinstance(record, Detection) for record in after)


def test_residuals_carry_the_errors_of_the_law_and_signs_their_episode() -> None:
    said = dragged()
    residuals = [record for record in said if isinstance(record, Residual)]
    place = residuals[0].names.index("parity_mechanical")
    z = np.array([record.z[place] for record in residuals])
    quiet, worn = z[200:900], z[1100:]
    assert 0.3 < np.nanstd(quiet) < 2.0
    assert np.nanmax(np.abs(worn)) > residuals[-1].thresholds[place] > 3.0
    assert np.array_equal(z[1000:1019], np.repeat(z[1000], 19), equal_nan=True)
    signs = [record for record in said if isinstance(record, Symbols)]
    assert signs[0].episode == 1
    assert "parity_mechanical" in {symbol.residual for symbol in signs[-1].symbols}


def test_an_observer_that_comes_back_goes_on_with_the_open_episode() -> None:
    verdict = [record for record in dragged() if isinstance(record, AmbiguityGroup)]
    again = evidence_pipeline(diagnosis(), STAND)
    again.handle(table())
    again.handle(verdict[-1])
    late = {name: values[1200:] for name, values in running(coulomb=150.0).items()}
    said = said_by(again, late, 2400)
    flags = [record for record in said if isinstance(record, Detection)]
    assert [(flag.episode, flag.test) for flag in flags] == [(1, TAKEN_OVER)]
    dropped = {each.fault for each in verdict[-1].dropped}
    last = [record for record in said if isinstance(record, AmbiguityGroup)][-1]
    assert last.episode == 1
    assert not dropped & {member.fault for member in last.members}


AXES = ("accelerometer_1_x", "accelerometer_2_x")


def answered(symbol_of: Callable[[str], str], coulomb: float = 150.0) -> list[Record]:
    """What is said of a drag on a stand with accelerometers, whose features have these symbols.

    Until just before the onset in one block, then scan by scan, for eleven seconds.
    """
    stand = diagnosis()
    stage = Pipeline((
        stand.observer(ObserverParameters()),
        stand.isolator(IsolatorParameters(), in_process=True),
    ))  # fmt: skip
    scans = block(running(coulomb=coulomb))
    out: list[Record] = list(stage.handle(table(AXES)))
    out += stage.handle_block(scans.part(slice(0, 850)))
    waiting: list[Record] = list(scans.part(slice(850, 2000)).records())
    while waiting:
        said = list(stage.handle(waiting.pop(0)))
        out += said
        waiting[:0] = [
            answer(r, symbol_of(r.feature)) for r in said if isinstance(r, FeatureRequest)
        ]
    return [*out, *stage.finish()]


def answer(request: FeatureRequest, symbol: str) -> FeatureValue:
    """With a symbol, to a request."""
    window = request.window_start_ns, request.window_end_ns
    stamp_ns = request.stamp_ns + 150_000_000
    what = stamp_ns, request.episode, request.step, request.feature, *window
    return FeatureValue(*what, 1.0, "1", symbol, 0.0, 1.0, "", 0.1)


def typical_of(fault: str) -> Callable[[str], str]:
    """The symbol that a feature most likely has of a fault."""
    table = diagnosis().told.features

    def symbol(feature: str) -> str:
        shares = table.probabilities(fault, feature)
        return table.alphabet[int(np.argmax(shares))]

    return symbol


@pytest.mark.in_turn(2)
@pytest.mark.parametrize("fault", ["jam", "ball_nut_friction"])
def test_features_part_what_the_relations_cannot(fault: str) -> None:
    said = answered(typical_of(fault))
    requests = [record for record in said if isinstance(record, FeatureRequest)]
    detected = next(record for record in said if isinstance(record, Detection))
    assert requests[0].stamp_ns - detected.stamp_ns >= 1_000_000_000
    last = [record for record in said if isinstance(record, AmbiguityGroup)][-1]
    assert last.outcome is Outcome.ISOLATED
    assert [member.fault for member in last.members] == [fault]
    assert last.features_computed
    assert math.isfinite(last.members[0].size)


def test_where_no_feature_can_be_computed_the_group_stays() -> None:
    last = [
        record for record in answered(lambda feature: "?") if isinstance(record, AmbiguityGroup)
    ][-1]
    assert {member.fault for member in last.members} == {"jam", "ball_nut_friction"}
