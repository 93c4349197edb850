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

"""A holding brake on the simulated axis: what it voids, what is told, and what is not said."""

from __future__ import annotations

import math
import shutil
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import pytest
import yaml
from support import stands
from support.places import ROOT
from support.stand_runs import records

from flea_diag.configuration.component import make_pipeline
from flea_diag.configuration.stand import Stand, load_stand
from flea_diag.core.machine_modes import HELD
from flea_diag.operator.stand_view import channels as channel_panel
from flea_diag.operator.state import OperatorState
from flea_diag.stages.digest import DECIDED, decided
from flea_diag.tools.replay.summary import summarise
from flea_diag.wire.records import (
    MODE,
    AmbiguityGroup,
    Cause,
    ChannelQuality,
    ChannelTable,
    DataQuality,
    Detection,
    Outcome,
    Quality,
    Record,
    Scan,
)

pytestmark = pytest.mark.slow

AXIS = ROOT / "config" / "stands" / "axis"
BRAKE = {"for_s": 3.0, "every_s": 12.0}
"""Engaged from 0 to 3 s and from 12 to 15 s."""
VOID = ("parity_mechanical", "parity_mechanical_dn")


@cache
def run() -> tuple[Record, ...]:
    """Twenty seconds of a healthy axis of the calibration."""
    motion = {"kind": "sine", "amplitude_m": 0.25, "frequency_hz": 0.2, "centre_m": 0.6}
    made = records(machine="axis", motion=motion, brake=BRAKE, duration_s=20.0, unit_seed=201)
    return tuple(r for r in made if isinstance(r, (ChannelTable, Scan)))


def read(change: Callable[[float], float]) -> tuple[Record, ...]:
    """The run, where the channel of the brake reads something else at each time in s."""
    column = next(r for r in run() if isinstance(r, Scan)).channels.index("brake_engaged")
    first_ns = run()[0].stamp_ns

    def changed(scan: Scan) -> Scan:
        values = list(scan.values)
        values[column] = change((scan.stamp_ns - first_ns) / 1e9)
        return replace(scan, values=tuple(values))

    return tuple(changed(r) if isinstance(r, Scan) else r for r in run())


@cache
def told(change: Callable[[float], float] | None = None) -> tuple[Record, ...]:
    given = run() if change is None else read(change)
    return tuple(stands.replay(make_pipeline(load_stand("axis"), observer_backend="numpy"), given))


def rows(said: tuple[Record, ...]) -> list[ChannelQuality]:
    qualities = stands.of(DataQuality, said)
    return [row for q in qualities for row in q.channels if row.channel == MODE]


def seconds(stamp_ns: int) -> float:
    return (stamp_ns - run()[0].stamp_ns) / 1e9


def test_a_brake_is_told_with_its_time_and_what_it_voids() -> None:
    found = {(row.reason, round(seconds(row.since_ns), 2)) for row in rows(told())}
    braked = f"braked: {', '.join(VOID)} not tested"
    # It settles for 0.1 s, and the smoothing holds it for 0.31 s; the sine slows down for 1 s.
    assert found == {(braked, 0.0), ("", 3.4), (braked, 12.0), ("", 15.4)}
    assert {row.quality for row in rows(told())} == {Quality.GOOD}


def test_holding_under_a_brake_is_no_evidence_and_no_bad_data() -> None:
    assert not stands.of(Detection, told())
    outcomes = {group.outcome for group in stands.of(AmbiguityGroup, told())}
    assert outcomes <= {Outcome.NOMINAL, Outcome.NOT_OBSERVABLE}
    after = next(q for q in stands.of(DataQuality, told()) if seconds(q.stamp_ns) > 15.0)
    causes = {test.cause for test in after.judged if test.residual in VOID}
    assert causes <= {Cause.VOID, Cause.AT_REST}
    assert not any(test.cause.is_of_the_data for test in after.judged if not test.judged)


def test_without_its_channel_the_same_brake_is_taken_for_a_drag() -> None:
    """What the mode is there for: the weight is held, and no current says by what."""
    found = stands.of(Detection, told(lambda _: 0.0))
    assert found
    assert seconds(found[0].stamp_ns) < 14.0


def test_the_verdict_says_the_mode() -> None:
    said = [g.words for g in stands.of(AmbiguityGroup, told()) if seconds(g.stamp_ns) > 11.9]
    assert any(
        f"; braked since 12.00 s after the start, {', '.join(VOID)} not tested" in words
        for words in said
    )
    assert "braked" not in said[-1]


def test_a_mode_that_is_not_read_is_unknown_and_said_to_be() -> None:
    said = told(lambda time_s: math.nan if time_s > 8.0 else float(time_s < 3.0))
    assert rows(said)[-1].reason.startswith("braked or not, for its channel is not read: ")
    last = stands.of(AmbiguityGroup, said)[-1]
    assert last.outcome is Outcome.DATA_UNUSABLE
    assert "brake_engaged unusable" in last.words


def test_blocks_and_single_scans_decide_alike() -> None:
    pipeline = make_pipeline(load_stand("axis"), observer_backend="numpy")
    blocks = tuple(stands.replay(pipeline, run()))
    for kind in DECIDED:
        assert list(map(decided, stands.of(kind, blocks))) == [
            decided(record) for record in stands.of(kind, told())
        ]
    assert rows(blocks) == rows(told())


def test_the_summary_and_the_console_show_it() -> None:
    known = summarise([*run(), *told()])["data_quality"][MODE]
    assert [(s["from_s"], s["to_s"]) for s in known["stretches"]] == [(0.0, 3.4), (12.0, 15.4)]
    quality = next(q for q in stands.of(DataQuality, told()) if 12.0 <= seconds(q.stamp_ns) < 15.0)
    panel = channel_panel(OperatorState(quality=quality))
    assert panel is not None
    assert any(line.text.startswith(f"{MODE} ") and "braked" in line.text for line in panel.lines)


@pytest.fixture(scope="module")
def untold(tmp_path_factory: pytest.TempPathFactory) -> Stand:
    """The axis, where nobody has said that it has a brake."""
    folder = tmp_path_factory.mktemp("untold") / "axis"
    shutil.copytree(AXIS, folder)
    described, calibrated = (folder / name for name in ("actuator.yaml", "calibration.yaml"))
    content = yaml.safe_load(described.read_text("utf-8"))
    del content["modes"]
    described.write_text(yaml.safe_dump(content, sort_keys=False), "utf-8")
    known = yaml.safe_load(calibrated.read_text("utf-8"))
    del known["actuator_sha256"]
    known["channels"].remove("brake_engaged")
    calibrated.write_text(yaml.safe_dump(known, sort_keys=False), "utf-8")
    (folder / "channels.yaml").unlink()
    stand = folder / "stand.yaml"
    stand.write_text(stand.read_text("utf-8").replace("channels: channels.yaml\n", ""), "utf-8")
    return load_stand(str(folder))


def test_where_no_channel_tells_a_weight_without_current_is_held_and_said_to_be(
    untold: Stand,
) -> None:
    said = tuple(stands.replay(make_pipeline(untold, observer_backend="numpy"), run()))
    assert not stands.of(Detection, said)
    held = {round(seconds(row.since_ns)) for row in rows(said) if row.reason.startswith(HELD)}
    # The first is known once the smoothing is full, and it has stood for as long again.
    assert held == {1, 12}
    assert all("braked" not in row.reason for row in rows(said))


def test_what_stands_against_the_current_of_its_motor_is_not_held(untold: Stand) -> None:
    """A carriage that has seized: the motor pushes, and nothing moves."""
    seized = [{"fault": "jam", "onset_s": 8.0, "size": 20.0}]
    motion = {"kind": "sine", "amplitude_m": 0.25, "frequency_hz": 0.2, "centre_m": 0.6}
    made = records(machine="axis", motion=motion, faults=seized, duration_s=14.0, unit_seed=201)
    said = stands.replay(make_pipeline(untold, observer_backend="numpy"), made)
    assert stands.of(Detection, said)
    assert not any(row.reason for row in rows(tuple(said)))
