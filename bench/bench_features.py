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

"""CPU time of vibration features: each one, scipy equivalents, all of them, lazy against eager.

Input is 1 s of six axes at 20 kHz. CPU time on one core, least of several rounds over all
features; compare ratios, since absolute times depend on the machine. The second part diagnoses
simulated runs and compares their cost of vibration processing (including buffering, vibration
monitor and decoding) with computing all features of the learned table every second.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from statistics import fmean
from typing import Any

import numpy as np
from scipy import signal, stats
from summary import Figure, bench_parser, write_summary

from flea_diag.configuration.knowledge import load_features
from flea_diag.configuration.stand import load_stand
from flea_diag.core.choice.feature_choice import FeatureChooser
from flea_diag.core.vibration.features import compute_all
from flea_diag.core.vibration.window import Window
from flea_diag.tools.features.bench import AXES, bench_window, costs_s, library_s
from flea_diag.tools.features.study import Plan, study

ROUNDS = 7
SEEDS = range(7000, 7003)
FAULTS = ("spall", "jam", "ball_nut_friction", "accelerometer_2_fault")
RATE_HZ = 20_000.0


def _welch(window: Window) -> object:
    return signal.welch(window.centred, RATE_HZ, nperseg=1024)


def _envelope(window: Window) -> object:
    band = signal.butter(4, (1500.0, 9500.0), "bandpass", fs=RATE_HZ, output="sos")
    filtered = signal.sosfiltfilt(band, window.centred)
    return np.abs(np.fft.rfft(np.abs(signal.hilbert(filtered))))


def _coherence(window: Window) -> object:
    return signal.coherence(window.centred[:3], window.centred[3:], RATE_HZ, nperseg=1024)


RIVALS: dict[str, tuple[str, Callable[[Window], object]]] = {
    "kurtosis": ("scipy.stats.kurtosis", lambda w: stats.kurtosis(w.centred, axis=1)),
    "skewness": ("scipy.stats.skew", lambda w: stats.skew(w.centred, axis=1)),
    "spectral_centroid": ("scipy.signal.welch", _welch),
    "nut_line": ("sosfiltfilt, hilbert, FFT", _envelope),
    "coherence": ("scipy.signal.coherence", _coherence),
}
"""Feature -> the equivalent computation by scipy, on the same six axes."""


def cpu_s(work: Callable[[], object]) -> float:
    """CPU time of one call."""
    begin = time.process_time_ns()
    work()
    return (time.process_time_ns() - begin) / 1e9


def rivals_s() -> dict[str, float]:
    """Least CPU time of each scipy equivalent."""
    best = dict.fromkeys(RIVALS, float("inf"))
    for _ in range(ROUNDS):
        for name, (_, work) in RIVALS.items():
            window = bench_window()
            best[name] = min(best[name], cpu_s(lambda: work(window)))  # noqa: B023
    return best


def features() -> list[Figure]:
    """Every feature on both accelerometers, and those that scipy has."""
    figures = []
    found, rivals = costs_s(ROUNDS, both=True), rivals_s()
    print(f"{'1 s x 6 axes, 20 kHz':32s}{'us':>9s}{'of std':>9s}   scipy")
    for name, spent in found.items():
        rival = ""
        if name in rivals:
            rival = f"{RIVALS[name][0]} {rivals[name] * 1e6:.0f} us, {rivals[name] / spent:.1f} x"
            figures.append(
                Figure(f"{name}, speed", rivals[name] / spent, "x", ROUNDS, against=RIVALS[name][0])
            )
        print(f"{name:32s}{spent * 1e6:9.0f}{spent / found['std']:9.1f}   {rival}")
    table = load_features("feature_table.yaml").features
    some = min(cpu_s(lambda: compute_all(table, bench_window())) for _ in range(ROUNDS))
    some -= min(cpu_s(bench_window) for _ in range(ROUNDS))
    print(f"{'learned table, shared FFT':32s}{some * 1e6:9.0f}{some / found['std']:9.1f}")
    whole = library_s()
    print(f"{'whole library, shared FFT':32s}{whole * 1e6:9.0f}{whole / found['std']:9.1f}")
    against = "one standard deviation of the same window"
    return [
        *figures,
        Figure("cost of the learned table", some / found["std"], "x", ROUNDS, against=against),
        Figure("cost of the whole library", whole / found["std"], "x", ROUNDS, against=against),
    ]


def lazy() -> list[Figure]:
    """Lazy over always, on diagnosed runs; what choosing the features took, beside it."""
    planned: list[float] = []
    choose = FeatureChooser.next

    def timed(chooser: FeatureChooser, *given: Any, **named: Any) -> str | None:
        begin = time.process_time_ns()
        choice = choose(chooser, *given, **named)
        planned.append((time.process_time_ns() - begin) / 1e6)
        return choice

    FeatureChooser.next = timed  # type: ignore[method-assign]
    runs = list(study(Plan(FAULTS, load_stand(), load_stand().features), SEEDS))
    FeatureChooser.next = choose  # type: ignore[method-assign]
    lazy_s, eager_s = fmean(r.lazy_s for r in runs), fmean(r.eager_s for r in runs)
    print(f"{len(runs)} runs of 22 s, {fmean(len(r.features) for r in runs):.1f} features each")
    print(f"lazy {lazy_s * 1e3:.1f} ms, always {eager_s * 1e3:.1f} ms: {lazy_s / eager_s:.2%}")
    print(f"choosing {sum(planned) / len(runs):.2f} ms a run, features alone and trees included")
    slowest_ms = max(r.answer_ms for r in runs)
    print(f"slowest answer {slowest_ms:.1f} ms (budget 150 ms)")
    n, seed = len(runs), f"{SEEDS.start} to {SEEDS.stop - 1}"
    return [
        Figure("CPU of vibration on demand", 100.0 * lazy_s / eager_s, "%", n, seed=seed,
               against="all features of the table every second"),
        Figure("features computed a run", fmean(len(r.features) for r in runs), "", n, seed=seed),
        Figure("choosing them, a run", sum(planned) / n, "ms", n, seed=seed),
        Figure("slowest answer", slowest_ms, "ms", n, seed=seed, against="a budget of 150 ms"),
    ]  # fmt: skip


if __name__ == "__main__":
    options = bench_parser(__doc__).parse_args()
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    print(f"{len(AXES)} axes: {', '.join(AXES)}")
    write_summary("features", [*features(), *lazy()], options.json)
