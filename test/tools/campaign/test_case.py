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

"""The list of runs that a campaign is: the same each time, and no run scored by what it taught."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from support.evaluations import campaign
from support.stand_runs import SINE, scenario

from flea_diag.errors import ConfigurationError
from flea_diag.tools.campaign.campaign import Campaign
from flea_diag.tools.campaign.case import Case, plan, plan_sha256
from flea_diag.tools.campaign.case_records import records_of
from flea_diag.tools.campaign.recording_set import RecordingSet
from flea_diag.tools.stand.simulate import write_bag
from flea_diag.wire.records import Scan, Truth

DRAWN = {
    "kind": "drawn",
    "name": "d",
    "seed": 3,
    "times": 2,
    "vibration": False,
    "rows": [{"cases": 2}, {"title": "Jam", "fault": "jam", "sizes": [0.5, 1.0], "cases": 4}],
}


@pytest.fixture(scope="module")
def bags(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Five nominal bags of 20 s and a jam."""
    folder = tmp_path_factory.mktemp("bags")
    for seed in range(5):
        run = scenario(seed=seed, name=f"n{seed}", duration_s=20.0, motion=SINE)
        write_bag(run, folder / f"BatchProfile_sine1{seed}_x_Nominal_Low")
    jam = scenario(name="j", duration_s=20.0, faults=[{"fault": "jam", "onset_s": 0.0}])
    write_bag(jam, folder / "BatchProfile_sine11_y_Jam_Low")
    return folder


def planned(given: Campaign, output: Path) -> tuple[Case, ...]:
    return tuple(plan(given, RecordingSet(given, output)))


def recorded(bags: Path, **changes: Any) -> Campaign:
    sources = [
        {"kind": "recordings", "name": "r", "files": f"{bags}/*"},
        {"kind": "injections", "name": "i", "files": f"{bags}/*", "cases": 5,
         "rows": ["motor_current bias", "motor_temperature dead"]},
        {"kind": "switches", "name": "s", "nominal": f"{bags}/*", "faulty": f"{bags}/*"},
    ]  # fmt: skip
    return campaign(calibration="halves", sources=sources, **changes)


def test_another_machine_runs_on_one_unit_with_noise_of_each_run(tmp_path: Path) -> None:
    rows = [{"cases": 2}, {"title": "Magnets", "fault": "magnet_loss", "low": 0.1, "high": 0.2}]
    drawn = {**DRAWN, "machine": "ema", "unit_seed": 7, "times": 1, "rows": rows}
    made = [case.recipe.scenario for case in planned(campaign(sources=[drawn]), tmp_path)]
    assert {(run["machine"], run["unit_seed"]) for run in made} == {("ema", 7)}
    assert len({run["seed"] for run in made}) == len(made) == 3
    assert max(abs(run["load"]["constant_n"]) for run in made) > 400.0  # beyond the FLEA's limit
    assert "machine" not in planned(campaign(sources=[DRAWN]), tmp_path / "f")[0].recipe.scenario


def test_drawing_again_gives_the_same_runs(tmp_path: Path) -> None:
    given = campaign(sources=[DRAWN])
    cases = planned(given, tmp_path)
    assert cases == planned(given, tmp_path / "elsewhere")
    assert Counter(case.row for case in cases) == {"Nominal": 4, "Jam": 8}
    assert len({case.key for case in cases}) == len(cases)
    other = campaign(sources=[{**DRAWN, "seed": 4}])
    assert plan_sha256(other, planned(other, tmp_path)) != plan_sha256(given, cases)
    strict = campaign(sources=[DRAWN], expect={"jam": []})
    assert plan_sha256(strict, cases) != plan_sha256(given, cases)


def test_a_plan_is_made_anew_each_time_and_kept_nowhere(tmp_path: Path) -> None:
    given = campaign(sources=[DRAWN], configurations=["hybrid", "structural"])
    found = plan(given, RecordingSet(given, tmp_path))
    first, again = list(found), list(found)
    assert first == again
    assert first[0] is not again[0]
    assert len(found) == len(first) == 24


def test_configurations_run_the_same_cases(tmp_path: Path) -> None:
    given = campaign(sources=[DRAWN], configurations=["hybrid", "structural"])
    cases = planned(given, tmp_path)
    ours, others = cases[:12], cases[12:]
    assert [case.recipe for case in ours] == [case.recipe for case in others]
    assert {case.configuration for case in others} == {"structural"}


def test_no_nominal_run_is_scored_by_a_calibration_that_it_taught(
    bags: Path, tmp_path: Path
) -> None:
    cases = planned(recorded(bags), tmp_path)
    assert {case.kind for case in cases} == {"simulated", "injected", "spliced"}
    for case in cases:
        assert case.recipe.recording not in case.learned_from
        assert len(case.learned_from) in (2, 3)
    folds = Counter(case.id for case in cases)
    assert folds["r/BatchProfile_sine11_y_Jam_Low"] == 2
    assert {n for name, n in folds.items() if "Nominal" in name or name[0] in "is"} == {1}


def test_only_runs_of_the_same_motion_are_joined(bags: Path, tmp_path: Path) -> None:
    (joined,) = (case for case in planned(recorded(bags), tmp_path) if case.kind == "spliced")
    assert "sine11_x_Nominal" in joined.recipe.recording
    assert "sine11_y_Jam" in joined.recipe.faulty


def test_an_injection_moves_one_channel_from_its_onset_on(bags: Path, tmp_path: Path) -> None:
    cases = [case for case in planned(recorded(bags), tmp_path) if case.row == "motor_current bias"]
    onsets = set()
    for case in cases:
        run = list(records_of(case.recipe))
        (truth,) = (record for record in run if isinstance(record, Truth))
        before = [s for s in records_of(type(case.recipe)(recording=case.recipe.recording))
                  if isinstance(s, Scan)]  # fmt: skip
        after = [record for record in run if isinstance(record, Scan)]
        size = float(dict(truth.details)["size"])
        assert 0.3 <= abs(size) <= 1.0
        for one, other in zip(before, after, strict=True):
            moved = other.value("motor_current") - one.value("motor_current")
            assert moved == pytest.approx(size if one.stamp_ns >= truth.onset_ns else 0.0)
            assert one.value("load_force") == other.value("load_force")
        onsets.add(truth.onset_ns - before[0].stamp_ns)
    assert len(onsets) == 5
    assert all(8e9 <= onset <= 12e9 for onset in onsets)


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ({"kind": "recordings", "files": "nowhere/*.data"}, "no recording matches 'nowhere/"),
        ({"kind": "injections", "files": "{bags}/*Jam*"}, "no nominal recording to inject"),
        ({"kind": "injections", "files": "{bags}/*", "rows": ["x y"]}, "'x y' is unknown"),
        ({**DRAWN, "rows": [{"fault": "rust"}]}, "unknown fault 'rust'"),
    ],
)
def test_what_cannot_be_run_is_refused(
    source: dict[str, Any], words: str, bags: Path, tmp_path: Path
) -> None:
    if "files" in source:
        source = {**source, "files": source["files"].format(bags=bags)}
    with pytest.raises(ConfigurationError, match=words):
        planned(campaign(sources=[source]), tmp_path)
