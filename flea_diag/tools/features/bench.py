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

"""CPU time of features, measured on a window of synthetic vibration in motion."""

from __future__ import annotations

import time
from collections.abc import Mapping

import numpy as np

from flea_diag.configuration.stand import load_stand
from flea_diag.core.vibration.features import (
    FEATURES,
    Feature,
    FeatureId,
    Scope,
    all_ids,
    compute_all,
)
from flea_diag.core.vibration.window import Window

CLOCK_NS = 1000
"""Least time that a clock tells, also one that somebody has stopped."""
AXES = tuple(f"accelerometer_{number}_{axis}" for number in (1, 2) for axis in "xyz")


def bench_window(rate_hz: float = 20_000.0, orders: Mapping[str, float] | None = None) -> Window:
    """Noise of 1 s on six axes while the shaft oscillates; with empty caches.

    ``orders`` of the lines are those of the shipped stand, unless given.
    """
    orders = load_stand().kinematics.orders() if orders is None else orders
    count = round(rate_hz)
    draw = np.random.default_rng(0)
    samples = draw.standard_normal((count, len(AXES)), dtype=np.float32)
    scan_s = np.arange(100) / 100.0
    slow = {
        "motor_speed": 80.0 * np.cos(2.0 * np.pi * 0.9 * scan_s + 0.3),
        "motor_current": draw.standard_normal(len(scan_s)),
        "motor_temperature": 25.0 + draw.standard_normal(len(scan_s)),
        "nut_temperature": 25.0 + draw.standard_normal(len(scan_s)),
        "load_force": 100.0 * draw.standard_normal(len(scan_s)),
    }
    speed = 80.0 * np.cos(2.0 * np.pi * 0.9 * np.arange(count) / rate_hz + 0.3)
    return Window(samples, rate_hz, AXES, speed, slow, scan_s, orders)


def costs_s(repeats: int = 9, both: bool = False) -> dict[str, float]:
    """Least CPU time of each feature by name, on one accelerometer or on ``both``.

    Repeats run over all features in turn, so that other load on the machine affects all equally.
    """
    rounds = [
        {name: _timed(_ids(row, both)) for name, row in FEATURES.items()} for _ in range(repeats)
    ]
    return {name: min(found[name] for found in rounds) for name in FEATURES}


def _ids(feature: Feature, both: bool) -> list[str]:
    if feature.scope is not Scope.ACCELEROMETER:
        return [str(FeatureId(feature))]
    names = ("accelerometer_1", "accelerometer_2") if both else ("accelerometer_2",)
    return [str(FeatureId(feature, name)) for name in names]


def library_s() -> float:
    """Least CPU time of all features on both accelerometers, on one window with shared spectra."""
    texts = list(all_ids(AXES))
    return min(_timed(texts) for _ in range(5))


def _timed(texts: list[str]) -> float:
    window = bench_window()
    begin = time.process_time_ns()
    compute_all(texts, window)
    return max(time.process_time_ns() - begin, CLOCK_NS) / 1e9
