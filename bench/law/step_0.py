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

"""One day of proof: what one law of a healthy recording tells.

python bench/law/step_0.py --switches FOLDER --nominal FOLDER [--json FILE]

Offline, no stage and no wire, on window means of the FLEA's recordings below FLEA_DATA_DIR:

(a) left-out log score and standardised means, by the law and by noise that holds everything;
(b) evidence of nothing, another unit, or a fault from before the recording: each healthy recording
    by the law of the others, jams and spalls by the law of all healthy ones;
(c) the smallest jam, bias and scaling by the information matrix at n = 4, 8, 16, 29, 20 orders;
(d) simulated switches to another healthy unit, and a bias of the current after them, in pairs. The
    folders hold bags of `flea simulate unit_switch` and of healthy scenarios, --no-vibration.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from summary import Figure, bench_parser, share, write_summary

from flea_diag.core.evidence.hypotheses import unit_variance
from flea_diag.core.run_law.run_windows import WINDOW_S
from flea_diag.core.run_law.visible_sizes import limit_nats, size_errors
from flea_diag.tools.calibrate.law_windows import WindowItem
from law.offline import weighed
from law.recordings import calibrated_on, design_of, imported, kinds, read_faulty, shipped

RATE = 0.1
SIZES = ("jam, coulomb drag", "motor_current_bias", "load_force_bias", "motor_current_scaling")
COUNTS, ORDERS, SEED = (4, 8, 16, 29), 20, 16
BIAS_A, BIAS_AT_S, BEGINS_S, EVERY = 0.5, 22.0, 4.0, 4
ADOPTED_NATS = 5.0


def evidence(design: Any, fit: Any, run: Any, **more: int) -> Any:
    """Weighed hypotheses of one recording by a law."""
    unit = unit_variance(fit.law, fit.columns)
    return weighed(fit.law, fit.columns, design.faults, run, unit, **more)


def real(folder: Path) -> Iterator[Figure]:
    """Parts (a) to (c)."""
    bags = imported(folder, "")
    nominal = [bag for bag in bags if "_Nominal_" in bag.name]
    recordings, calibration = calibrated_on(nominal)
    design = design_of(calibration, recordings)
    runs = {r.name: r for r in design.windows(recordings)}
    faulty = kinds(read_faulty([bag for bag in bags if bag not in nominal]))
    names = sorted(runs)
    every = design.learned([runs[name] for name in names])
    yield from scores(every)
    limit = math.log(len(design.faults) / (RATE * 30.0 / 3600.0))
    yield Figure("limit of a fault from before", limit, "nats")
    print("unsound:", every.unsound, every.noisy)
    alarms, largest = 0, -math.inf
    for name in names:
        fit = design.learned([runs[other] for other in names if other != name])
        found = evidence(design, fit, runs[name])
        alarms += found.over_null > limit
        largest = max(largest, found.over_null)
        print(f"{name}: unit {found.unit:.1f}, {found.best[0]} {found.over_null:.1f}", flush=True)
    yield share("healthy, left out: alarm", alarms, len(names))
    yield Figure("healthy, left out: largest evidence of a fault", largest, "nats", len(names))
    jams = [evidence(design, every, run) for run in design.windows(faulty["Jam"])]
    right = sum(f.over_null > limit and "jam" in f.group() for f in jams)
    yield share("jam: found and in the group", right, len(jams))
    least = min(f.over_null for f in jams)
    yield Figure("jam: smallest evidence", least, "nats", len(jams))
    spalls = [evidence(design, every, run) for run in design.windows(faulty["Spall"])]
    yield share("spall: quiet", sum(f.over_null <= limit for f in spalls), len(spalls))
    yield Figure("spall: largest evidence of a fault", max(f.over_null for f in spalls), "nats",
                 len(spalls))  # fmt: skip
    yield from growing(design, [runs[name] for name in names])


def scores(fit: Any) -> Iterator[Figure]:
    """Part (a)."""
    score = fit.law.score
    yield Figure("left-out log score, the law", score.log_score, "nats a value", score.means)
    yield Figure("left-out log score, noise that holds everything", score.separate, "nats a value",
                 score.means)  # fmt: skip
    yield Figure("standardised means of left-out recordings", score.spread, "1", score.means)
    yield Figure("of them beyond 2", 100.0 * score.beyond_two, "%", score.means)


def growing(design: Any, runs: list[Any]) -> Iterator[Figure]:
    """Part (c): sizes at the limit for a fault with an onset and from before, by recordings."""
    limit = math.sqrt(2.0 * limit_nats(RATE, len(design.faults)))
    places = [k for k, c in enumerate(design.faults.columns) if c.name in SIZES]
    orders = np.random.default_rng(SEED)
    chosen = [orders.permutation(len(runs)) for _ in range(ORDERS)]
    for count in COUNTS:
        found = []
        for order in chosen[: 1 if count >= len(runs) else ORDERS]:
            fit = design.learned([runs[k] for k in order[:count]])
            errors = size_errors(fit.law, fit.columns, design.faults, runs)
            found.append([np.median(e[:, places], axis=0) for e in (errors.onset, errors.before)])
        sizes = limit * np.array(found)
        for k, place in enumerate(places):
            column = design.faults.columns[place]
            for j, when in enumerate(("onset", "before")):
                values = sizes[:, j, k]
                yield Figure(f"{column.name} from {when}, {count} recordings", values.mean(),
                             column.unit, len(values), values.min(), values.max())  # fmt: skip


def switched(switches: Path, nominal: Path) -> Iterator[Figure]:
    """Part (d)."""
    calibration = shipped()
    recordings = [
        replace(recording, serial=recording.run.name.rpartition("_")[2])
        for recording in read_faulty(sorted(nominal.iterdir()))
    ]
    design = design_of(calibration, recordings)
    healthy = design.windows(recordings)
    fit = design.learned(healthy)
    print("simulated:", fit.law.score, fit.unsound)
    limit = limit_nats(RATE, len(design.faults))
    recordings = read_faulty(sorted(switches.iterdir()))
    work = design.work
    alarms, found, right = 0, 0, 0
    for recording in recordings:
        plain = onset_evidence(design, fit, work.windows(WindowItem(recording.run, "")))
        alarms += plain[1] > limit
        print(f"{recording.run.name}: {plain}", flush=True)
        for sign in (1.0, -1.0):
            rows = recording.run.rows.copy()
            at = round(BIAS_AT_S / calibration.period_s)
            rows[at:, work.effects().residuals.index["motor_current"]] += sign * BIAS_A
            biased = replace(recording.run, rows=rows)
            best, nats = onset_evidence(design, fit, work.windows(WindowItem(biased, "")))
            found += nats > limit
            right += nats > limit and best == "motor_current_bias"
            print(f"  {sign * BIAS_A:+} A: {best} {nats:.1f}", flush=True)
    count = len(recordings)
    yield share("switch to another unit: alarm", alarms, count)
    yield share("a bias of the current after it: found", found, 2 * count)
    yield share("a bias of the current after it: best by name", right, 2 * count)


def onset_evidence(design: Any, fit: Any, run: Any) -> tuple[str, float]:
    """Best fault over all onsets, beside the best exchange of the unit: name and nats over null."""
    onsets = range(round(BEGINS_S / WINDOW_S), len(run) - round(1.0 / WINDOW_S), EVERY)
    alone = {t: evidence(design, fit, run, onset=t) for t in onsets}
    at = max(alone, key=lambda t: alone[t].unit)
    if alone[at].unit < ADOPTED_NATS:
        best = max(alone.values(), key=lambda w: w.best[1])
        return best.best[0], best.over_null
    near = range(at - EVERY, at + EVERY + 1)
    at = max(near, key=lambda t: evidence(design, fit, run, onset=t).unit)
    # The unit is another one from there on; a fault must explain more than that, or instead.
    alone[at] = evidence(design, fit, run, onset=at)
    unit = alone[at].unit
    later = [evidence(design, fit, run, onset=t, switched=at) for t in onsets]
    best = max(later, key=lambda w: w.best[1] - max(0.0, w.unit))
    instead = max(alone.values(), key=lambda w: w.best[1])
    return max(
        (best.best[0], best.best[1] - max(0.0, best.unit)),
        (instead.best[0], instead.best[1] - unit),
        key=lambda entry: entry[1],
    )


def main() -> int:
    """Run and print."""
    parser = bench_parser(__doc__)
    parser.add_argument("--switches", type=Path, help="bags of unit_switch")
    parser.add_argument("--part", choices=("real", "switches"))
    parser.add_argument("--nominal", type=Path, help="bags of healthy scenarios")
    arguments = parser.parse_args()
    figures: list[Figure] = []
    if arguments.part != "switches":
        with TemporaryDirectory() as folder:
            figures += real(Path(folder))
    if arguments.part != "real":
        figures += switched(arguments.switches, arguments.nominal)
    for figure in figures:
        spread = "" if figure.low is None else f" ({figure.low:.4g} to {figure.high:.4g})"
        print(f"{figure.name}: {figure.value:.4g} {figure.unit}{spread}, n = {figure.n}")
    write_summary("step_0", figures, arguments.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
