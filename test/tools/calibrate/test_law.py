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

"""The law of the recordings of a calibration: unsound ones among them, and what it can see."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from support.models import linear_ema as ema
from support.places import FLEA_STAND

from flea_diag.configuration.stand import load_stand
from flea_diag.core.calibration.calibration import Calibration, NominalRun
from flea_diag.core.calibration.calibration_reader import from_mapping
from flea_diag.core.isolation.detectability import shows_from, unseen_by_limits
from flea_diag.core.run_law.run_law import VisibleSize
from flea_diag.tools.calibrate.law import LawOfRecordings
from flea_diag.tools.calibrate.law_words import words
from flea_diag.tools.calibrate.nominal_recording import NominalRecording
from flea_diag.tools.calibrate.procedure import learn
from flea_diag.tools.calibrate.shared_work import ALONE
from flea_diag.tools.size_table import size_lines

STAND = load_stand(str(FLEA_STAND))


def recording(name: str, columns: ema.Columns) -> NominalRecording:
    return NominalRecording(
        NominalRun(name, ema.rows(columns, ema.STAND)), "s", ema.STAND, "mean", 0.01
    )


@cache
def healthy() -> tuple[NominalRecording, ...]:
    """Ten runs of 12 s: halves of the healthy ones, but for two."""
    found = []
    for n, columns in enumerate(ema.nominal_runs()[:5]):
        for half in (slice(0, 1200), slice(1200, 2400)):
            part = {name: values[half] for name, values in columns.items()}
            found.append(recording(f"run{n}_{half.start}", part))
    return tuple(found)


@cache
def dragged(n: int) -> NominalRecording:
    """A run with twice the friction."""
    motion, mean = ema.MOTIONS[n]
    columns = ema.run(
        ema.changed(coulomb=150.0, viscous=1500.0),
        12.0,
        motion,
        lambda t: mean + 40.0 * math.sin(1.3 * t),
    )
    return recording(f"dragged{n}", ema.noisy(columns, 70 + n))


@cache
def of_four() -> Calibration:
    """Of four of the healthy runs, without a catalogue."""
    return learn(list(healthy()[:4]), STAND.actuator, 0.1).calibration


@pytest.fixture(scope="module")
def found():
    runs = [*healthy(), dragged(0), dragged(2)]
    return learn(runs, STAND.actuator, 0.1, faults=STAND.faults)


@pytest.mark.in_turn(2)
def test_two_recordings_with_the_same_fault_do_not_mask_each_other(found):
    assert set(found.unlike) == {"dragged0", "dragged2"}
    for reason in found.unlike.values():
        assert "friction" in reason or "drag" in reason


def test_what_is_left_is_the_law_of_the_others_and_stands_in_the_file(found):
    calibration = found.calibration
    assert calibration.law.recordings == len(healthy())
    again = from_mapping(calibration.to_mapping(), "file")
    assert again.law.to_mapping() == calibration.law.to_mapping()
    said = "\n".join(words(calibration.law, found.relations))
    assert "by the tolerances of the description" in said
    assert "jam, coulomb drag" in said


@pytest.mark.in_turn(2)
def test_a_calibration_without_a_catalogue_holds_no_law_and_the_same_limits():
    plain = of_four()
    assert plain.law is None
    assert "law" not in plain.to_mapping()
    with_law = learn(list(healthy()[:4]), STAND.actuator, 0.1, faults=STAND.faults).calibration
    assert replace(with_law, law=None) == plain


def test_the_limits_show_a_drag_of_the_size_that_they_were_said_to(found):
    """Against the running detector, on a recording with that drag from a third on."""
    row = next(
        r for r in found.calibration.law.visible if (r.fault, r.size) == ("jam", "coulomb drag")
    )
    assert 5.0 < row.limits < 200.0
    assert row.onset < row.limits
    assert row.onset < row.before


VISIBLE = (
    VisibleSize("jam", "coulomb drag", "N", 30.0, 90.0, 30.0, 48.2),
    VisibleSize("jam", "viscous drag", "N s/m", 500.0, 900.0, 900.0, 1470.0),
    VisibleSize("motor_current_scaling", "scaling share", "1", 0.3, 0.4, 0.5, 0.9, 0.66),
    VisibleSize("dead", "share", "1", limits=math.inf, largest=1.0),
)


def test_a_fault_shows_from_the_sizes_that_reach_a_limit_within_the_catalogue():
    assert dict(shows_from(VISIBLE)) == {
        "jam": "coulomb drag 48.2 N or viscous drag 1.47e+03 N s/m"
    }
    assert unseen_by_limits(VISIBLE) == ("motor_current_scaling", "dead")


def test_a_size_beyond_the_catalogue_is_said_to_be_beyond():
    lines = list(size_lines(VISIBLE))
    assert ">0.66" in lines[3]
    assert "no size" in lines[4]


def law_of_parts(change) -> LawOfRecordings:
    """Of three recordings with their readings changed, by a calibration of healthy ones."""
    runs = [
        replace(row, run=replace(row.run, rows=change(row.run.rows.copy())))
        for row in healthy()[:3]
    ]
    return LawOfRecordings.of(of_four(), STAND.actuator, STAND.faults, runs, ALONE)


def test_recordings_of_half_a_second_make_no_law_and_say_so():
    law = law_of_parts(lambda rows: rows[:50])
    assert law.fit is None
    (line,) = law.noisy
    assert line.startswith("no law of healthy recordings: ")
    assert "record longer" in line


def test_recordings_at_rest_say_nothing_of_friction():
    law = law_of_parts(lambda rows: np.where(np.isfinite(rows), rows[:1], np.nan))
    terms = law.fit.law.terms if law.fit else ()
    assert "coulomb_friction_n" not in {term.name for term in terms}
