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

"""When a node counts its source as silent."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from flea_diag.nodes import health
from flea_diag.nodes.health import SILENT_AFTER_S, HealthReport
from flea_diag.nodes.stage.adapter import WATCH_S
from flea_diag.wire.records import Scan


class Clock:
    """In place of the module ``time``."""

    def __init__(self) -> None:
        self.now_s = 100.0

    def monotonic(self) -> float:
        return self.now_s

    def monotonic_ns(self) -> int:
        return round(1e9 * self.now_s)

    def process_time(self) -> float:
        return 0.0


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(health, "time", clock)
    return clock


def checked(report: HealthReport, clock: Clock, *turns_s: float) -> list[bool]:
    """Whether the source is silent after each of these times between checks."""
    said = []
    for turn_s in turns_s:
        clock.now_s += turn_s
        report.check()
        said.append(report.silent)
    return said


def report_of(clock: Clock) -> HealthReport:
    report = HealthReport(SimpleNamespace())
    report.taken()
    return report


def test_a_source_that_stops_is_silent_once_the_time_has_passed(clock: Clock) -> None:
    said = checked(report_of(clock), clock, *[WATCH_S] * 10)
    assert said.index(True) == round(SILENT_AFTER_S / WATCH_S)


def test_a_node_that_was_held_up_does_not_blame_its_source(clock: Clock) -> None:
    """What was sent meanwhile waits to be read when the check runs first."""
    report = report_of(clock)
    assert checked(report, clock, WATCH_S, 3.0) == [False, False]
    report.taken()
    assert not any(checked(report, clock, 3.0, WATCH_S, WATCH_S))


def test_a_source_that_stopped_during_a_pause_is_silent_soon_after_it(clock: Clock) -> None:
    said = checked(report_of(clock), clock, 3.0, *[WATCH_S] * 10)
    assert said.index(True) <= round(SILENT_AFTER_S / WATCH_S)


def test_nothing_is_silent_before_it_was_heard(clock: Clock) -> None:
    assert not any(checked(HealthReport(SimpleNamespace()), clock, *[WATCH_S] * 10))


@pytest.mark.parametrize(("ppm", "words"), [(900.0, "900 ppm slower"), (20.0, "running")])
def test_stamps_that_drift_against_arrival_are_said(clock: Clock, ppm: float, words: str) -> None:
    bus = SimpleNamespace(now_ns=lambda: 0, streams={}, state="active", replays=False, name="n")
    report, start_s = HealthReport(bus), clock.now_s
    for _ in range(400):
        clock.now_s += 0.1
        stamp_ns = round(1e9 * (start_s + (clock.now_s - start_s) * (1.0 - 1e-6 * ppm)))
        report.arrived(Scan, stamp_ns, late=False)
    report.taken()
    said = report.record()
    assert words in said.message
    assert float(dict(said.values)["stamp_drift_ppm"]) == pytest.approx(ppm, abs=2.0)
