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

"""The error of a single window is measured on runs that were not learned from."""

import numpy as np
import pytest

from flea_diag.core.choice.feature_learning import NOMINAL, Sample
from flea_diag.core.vibration.nominal_range import VibrationOperatingPoint
from flea_diag.tools.features.held_out import window_errors
from flea_diag.tools.features.samples import FeatureRun

FEATURES = ("accelerometer_1_std", "accelerometer_2_std", "accelerometer_2_crest")
RUNS, WINDOWS = 40, 4
MEANS = {NOMINAL: 0.0, "jam": 12.0, "spall": 24.0}


def runs(odd_share: float) -> list[FeatureRun]:
    """Runs of each fault; so large a share of the jammed ones sounds like a spall throughout."""
    draw, made = np.random.default_rng(5), []
    for fault, mean in MEANS.items():
        for number in range(RUNS):
            odd = fault == "jam" and number < odd_share * RUNS
            level = MEANS["spall"] if odd else mean
            samples = tuple(
                Sample(
                    fault,
                    VibrationOperatingPoint(float(draw.uniform(60.0, 90.0)), 100.0),
                    {f: float(np.exp(0.1 * (level + draw.standard_normal()))) for f in FEATURES},
                )
                for _ in range(WINDOWS)
            )
            made.append(FeatureRun(f"{fault} {number}", 20_000.0, samples))
    return made


def error_of(odd_share: float) -> float:
    costs = dict.fromkeys(FEATURES, 1.0)
    return window_errors(runs(odd_share), costs, FEATURES, 0.01, len(FEATURES))["jam"]["spall"]


def test_faults_that_no_window_confuses_leave_half_a_count() -> None:
    assert error_of(0.0) == pytest.approx(0.5 / (RUNS * WINDOWS + 1.0), rel=0.01)


def test_features_that_err_together_are_wrong_as_often_as_their_windows_are_odd() -> None:
    assert error_of(0.1) == pytest.approx(0.1, abs=0.02)
