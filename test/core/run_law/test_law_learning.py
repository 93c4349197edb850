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

"""The law of recordings that are drawn from one, and what it makes of unsound ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.models.law_design import COLUMNS, FAULTS, recording, recordings

from flea_diag.core.run_law.law_learning import learn_law
from flea_diag.core.run_law.run_law import RunLaw
from flea_diag.core.run_law.run_windows import RunWindows
from flea_diag.core.run_law.visible_sizes import visible_sizes
from flea_diag.fields.reader import read_as


def law_of(runs):
    return learn_law(runs, COLUMNS, FAULTS, ())


@pytest.mark.slow
def test_a_law_finds_what_recordings_were_drawn_by():
    runs = recordings(np.random.default_rng(1), 40)
    law = law_of(runs).law
    assert [term.run_sigma for term in law.terms] == pytest.approx([0.3, 0.1], rel=0.25)
    assert [row.white for row in law.noise] == pytest.approx([0.2, 0.2], rel=0.15)
    assert law.score is not None
    assert law.score.spread == pytest.approx(1.0, abs=0.2)
    assert law.score.log_score > law.score.separate


@pytest.mark.slow
def test_more_recordings_do_not_widen_what_they_differ_by():
    rng = np.random.default_rng(2)
    few, many = (law_of(recordings(rng, count)).law for count in (6, 40))
    assert many.terms[0].run_sigma <= 1.3 * few.terms[0].run_sigma


@pytest.mark.slow
@pytest.mark.parametrize("odd", [1, 2, 3])
def test_unsound_recordings_of_one_kind_do_not_mask_each_other(odd):
    rng = np.random.default_rng(3)
    runs = recordings(rng, 16 - odd)
    runs += [recording(rng, (3.0, 0.0), name=f"odd_{k}") for k in range(odd)]
    fit = law_of(runs)
    assert {runs[row.place].name for row in fit.unsound} == {f"odd_{k}" for k in range(odd)}
    assert {row.what for row in fit.unsound} <= {"drag", "jam, drag"}
    assert [row.size for row in fit.unsound] == pytest.approx([3.0] * odd, abs=0.6)
    assert fit.law.terms[0].run_sigma == pytest.approx(0.3, rel=0.5)


@pytest.mark.slow
def test_sound_recordings_are_named_unsound_in_one_of_hundreds():
    rng = np.random.default_rng(4)
    named = sum(len(law_of(recordings(rng, 12)).unsound) for _ in range(8))
    assert named <= 1


def test_a_relation_that_is_far_too_noisy_is_left_out_of_its_recording_alone():
    rng = np.random.default_rng(5)
    runs = recordings(rng, 12)
    runs[4].values[:, 1] += 5.0 * rng.standard_normal(len(runs[4]))
    fit = law_of(runs)
    assert not fit.unsound
    assert {(row.place, row.what) for row in fit.noisy} == {(4, "circuit")}
    assert np.isnan(fit.sound[4].values[:, 1]).all()


@pytest.mark.slow
def test_recordings_of_several_units_are_judged_by_their_own():
    rng = np.random.default_rng(6)
    runs = [
        recording(rng, (drag + 0.2 * rng.standard_normal(), 0.1 * rng.standard_normal()),
                  name=f"{unit}_{k}", unit=str(unit))
        for unit, drag in enumerate((-1.5, 1.4, 0.2, -0.6, 1.1, 0.5))
        for k in range(5)
    ]  # fmt: skip
    fit = law_of(runs)
    assert not fit.unsound
    assert (fit.law.units, fit.law.recordings) == (6, 30)
    assert fit.law.terms[0].run_sigma == pytest.approx(0.2, rel=0.35)
    assert 0.6 < fit.law.terms[0].unit_sigma < 2.0


def test_few_recordings_make_a_law_too():
    rng = np.random.default_rng(7)
    for count in (1, 2, 3):
        law = law_of(recordings(rng, count)).law
        assert np.isfinite([term.run_sigma for term in law.terms]).all()
        assert law.terms[0].run_sigma > 0.1


def without(run, relations):
    """A recording that lacks relations."""
    values = run.values.copy()
    values[:, relations] = np.nan
    return replace(run, values=values)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    "spoil",
    [
        lambda runs: [without(run, [1]) for run in runs],
        lambda runs: [without(runs[0], [0, 1]), *runs[1:]],
        lambda runs: [run.part(slice(0, 6)) for run in runs],
        lambda runs: [replace(run, values=np.zeros_like(run.values)) for run in runs],
        lambda runs: [runs[0]] * 4,
    ],
    ids=["a relation never formed", "a recording without any", "short", "constant", "duplicates"],
)
def test_recordings_that_say_little_make_a_wide_law_and_no_error(spoil):
    runs = spoil(recordings(np.random.default_rng(9), 4))
    fit = learn_law(runs, COLUMNS, FAULTS, [(1, 0)])
    assert np.isfinite([term.run_sigma for term in fit.law.terms]).all()
    assert len(visible_sizes(fit.law, fit.columns, FAULTS, fit.sound, 10.0, 3.5)) == len(FAULTS)


def test_a_law_is_the_same_after_its_file():
    law = law_of(recordings(np.random.default_rng(8), 8)).law
    again = read_as(RunLaw, law.to_mapping(), "law")
    assert again.to_mapping() == law.to_mapping()
    assert again.covariance == pytest.approx(law.covariance, rel=1e-4)
    assert again.contradictions() == []


def test_recordings_of_two_kinds_in_halves_are_all_kept():
    rng = np.random.default_rng(10)
    runs = [
        recording(rng, (drag, 0.0), name=f"{drag}_{k}") for drag in (0.0, 4.0) for k in range(7)
    ]
    fit = law_of(runs)
    assert not fit.unsound
    assert len(fit.sound) == len(runs)
    assert fit.law.terms[0].run_sigma > 1.0


def test_a_third_of_another_kind_is_kept_and_said_to_contradict_the_others():
    rng = np.random.default_rng(10)
    drags = [0.0] * 8 + [4.0] * 4
    fit = law_of([recording(rng, (drag, 0.0), name=f"run_{k}") for k, drag in enumerate(drags)])
    assert not fit.unsound
    assert {row.place for row in fit.contradicting} == {8, 9, 10, 11}
    assert len(fit.sound) == len(drags)


@pytest.mark.slow
@pytest.mark.parametrize("units", [2, 4])
def test_what_a_recording_of_every_unit_shows_is_of_its_motion(units):
    rng = np.random.default_rng(11)
    runs = [
        recording(rng, (4.0 * (k == 5) + 0.1 * rng.standard_normal(), 0.0), name=f"{unit}_{k}",
                  unit=str(unit))
        for unit in range(units)
        for k in range(6)
    ]  # fmt: skip
    fit = law_of(runs)
    heavy = {k for k, run in enumerate(runs) if run.name.endswith("_5")}
    kept = {row.place for row in fit.of_motion}
    if units == 2:  # two defects of one kind: too few to be of the motion
        assert {row.place for row in fit.unsound} == heavy
        assert not kept
    else:
        assert (kept, fit.unsound) == (heavy, ())
        assert len(fit.sound) == len(runs)


def test_a_motion_that_three_units_of_four_show_is_no_defect():
    rng = np.random.default_rng(14)
    runs = [
        recording(rng, (4.0 * (k == 5 and u > 0) + 0.1 * rng.standard_normal(), 0.0),
                  name=f"{u}_{k}", unit=str(u))
        for u in range(4) for k in range(6)
    ]  # fmt: skip
    fit = law_of(runs)
    assert {runs[row.place].name for row in fit.of_motion} == {"1_5", "2_5", "3_5"}
    assert not fit.unsound


@pytest.mark.slow
def test_two_motions_of_every_unit_do_not_contradict_the_others():
    """A third of the recordings are of two kinds that the description lacks: of no defect."""
    rng = np.random.default_rng(13)
    drags = (0.0, 0.0, 0.0, 0.0, 4.0, -4.0)
    runs = [
        recording(rng, (drag + 0.1 * rng.standard_normal(), 0.0), name=f"{u}_{k}", unit=str(u))
        for u in range(4) for k, drag in enumerate(drags)
    ]  # fmt: skip
    fit = law_of(runs)
    assert {runs[row.place].name[-1] for row in fit.of_motion} == {"4", "5"}
    assert (fit.unsound, fit.contradicting) == ((), ())
    assert len(fit.sound) == len(runs)


def test_a_relation_that_is_noisy_in_one_motion_of_every_unit_is_kept():
    rng = np.random.default_rng(12)
    runs = [recording(rng, (0.0, 0.0), name=f"{u}_{k}", unit=str(u)) for u in range(4)
            for k in range(6)]  # fmt: skip
    for run in runs:
        if run.name.endswith("_5"):
            run.values[:, 1] += 0.6 * rng.standard_normal(len(run))
    fit = law_of(runs)
    assert not fit.noisy
    assert not any(np.isnan(run.values).any() for run in fit.sound)


def stepping(rng: np.random.Generator, count: int, step: float) -> list[RunWindows]:
    """Healthy recordings whose drag steps by so much, up or down, half way."""
    made = []
    for k in range(count):
        run = recording(rng, (0.3 * rng.standard_normal(), 0.0), windows=240, name=f"run_{k}")
        values = run.values.copy()
        values[120:] += (-1) ** k * step * run.signals[120:, :, 2] * [1.0, 0.0]
        made.append(replace(run, values=values))
    return made


@pytest.mark.slow
def test_what_begins_within_healthy_recordings_is_known_as_that():
    steady = law_of(recordings(np.random.default_rng(8), 24)).law
    unsteady = law_of(stepping(np.random.default_rng(8), 24, 0.6)).law
    (still, _), (moved, _) = steady.feigned, unsteady.feigned
    assert still.onset_sigma < 0.1
    assert 0.3 < moved.onset_sigma < 1.0
    sizes = [visible_sizes(law, COLUMNS, FAULTS, recordings(np.random.default_rng(9), 8), 10.0, 3.5)
             for law in (steady, unsteady)]  # fmt: skip
    assert sizes[1][0].onset > 2.0 * sizes[0][0].onset


@pytest.mark.slow
def test_what_moves_within_a_recording_is_as_large_as_it_is_at_any_time():
    """A whole recording is a mean over it: of one that steps to the other side it is nothing."""
    law = law_of(stepping(np.random.default_rng(10), 24, 3.0)).law
    assert law.time_constant_s < 240 * 0.2
    assert law.terms[0].run_sigma > 1.0
