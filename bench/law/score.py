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

"""Score of the law of healthy recordings on the FLEA's, with seeds that are fixed here.

python bench/law/score.py [--part growing] [--part spoilt] [--part sizes] [--draws 5] [--json FILE]

growing: laws of 4, 8, 16 and 29 recordings in 20 random orders: the sizes that they see from before
    a recording, left-out recordings that alarm, and sound ones that are named unsound.
spoilt: recordings of a jammed unit, of another unit, or with a reading that lies or is dead, among
    healthy ones: whether they are named, and what a missed one does to the sizes that are seen.
sizes: said against found. Errors are put into the readings of left-out recordings from a third on;
    the size from which half of them are detected, by the law and by the diagnosis.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from summary import Figure, bench_parser, share, write_summary

from flea_diag.configuration.component import make_pipeline
from flea_diag.configuration.stand import load_stand
from flea_diag.core.run_law.run_sums import RunSums
from flea_diag.core.run_law.visible_sizes import BEFORE, FOLLOWED_S, limit_nats, size_errors
from flea_diag.tools.calibrate.calibrate import write_calibration
from flea_diag.tools.calibrate.law_windows import WindowItem
from flea_diag.tools.evaluate.case_run import diagnose
from flea_diag.wire.blocks import ScanBlock
from flea_diag.wire.records import AmbiguityGroup, ChannelInfo, ChannelTable
from law.recordings import calibrated_on, design_of, imported, kinds, read_faulty

SEED = 90171
"""Of orders and draws; no other was looked at with these parts, but for 90161 by the law before."""
RATE = 0.1
COUNTS, ORDERS = (4, 8, 16, 29), 20
SHOWN = ("jam, coulomb drag", "motor_current_bias", "load_force_bias", "motor_current_scaling")
SPOILT = ((8, 1), (16, 1), (16, 2), (29, 2), (29, 3))
ERRORS: dict[str, tuple[str, Callable[[Any, Any, float], Any]]] = {
    "motor_current_bias": ("motor_current", lambda y, t, size: y + size),
    "motor_current_scaling": ("motor_current", lambda y, t, size: y / (1.0 - size)),
    "motor_current_drift": ("motor_current", lambda y, t, size: y + size * t),
    "motor_voltage_bias": ("motor_voltage", lambda y, t, size: y + size),
    "motor_voltage_scaling": ("motor_voltage", lambda y, t, size: y / (1.0 - size)),
    "load_force_bias": ("load_force", lambda y, t, size: y + size),
    "load_force_scaling": ("load_force", lambda y, t, size: y / (1.0 - size)),
    "load_force_drift": ("load_force", lambda y, t, size: y + size * t),
    "motor_temperature_bias": ("motor_temperature", lambda y, t, size: y + size),
    "nut_temperature_bias": ("nut_temperature", lambda y, t, size: y + size),
}
"""Errors of a reading y, t seconds after the onset; a scaling takes a share of what is read."""
STEPS = (0.35, 0.5, 0.7, 1.0, 1.4, 2.0)
"""Sizes around the one that is said."""
BEYOND = 3.0
"""What is found at none of these sizes."""
DIAGNOSED = 8
"""Recordings that the diagnosis has an error put into, for each row and step."""


class Stand:
    """Recordings, a calibration of the healthy ones, and their windows."""

    def __init__(self, recordings: Any, calibration: Any, stand: str = "") -> None:
        self.recordings, self.calibration = recordings, calibration
        self.design = design_of(calibration, recordings, stand)
        self.runs = self.design.windows(recordings)
        self.index = self.design.work.effects().residuals.index
        self.places = [k for k, c in enumerate(self.design.faults.columns) if c.name in SHOWN]
        self.jams: list[Any] = []
        self.others: list[Any] = []

    @classmethod
    def real(cls, folder: Path) -> Stand:
        """The recordings below FLEA_DATA_DIR."""
        bags = imported(folder, "")
        nominal = [bag for bag in bags if "_Nominal_" in bag.name]
        stand = cls(*calibrated_on(nominal))
        faulty = kinds(read_faulty([bag for bag in bags if bag not in nominal]))
        stand.jams = stand.design.windows(faulty["Jam"])
        stand.others = stand.design.windows(faulty["Spall"])
        return stand

    def changed(
        self, recording: Any, channel: str, change: Callable[[Any, Any], Any], at: int
    ) -> Any:
        """A recording whose reading is another one from a scan on."""
        rows = recording.run.rows.copy()
        t = np.arange(len(rows) - at) * self.calibration.period_s
        rows[at:, self.index[channel]] = change(rows[at:, self.index[channel]], t)
        return replace(recording, run=replace(recording.run, rows=rows))

    def windows(self, recording: Any) -> Any:
        """Windows of one recording."""
        return self.design.work.windows(WindowItem(recording.run, recording.serial))

    def sizes(self, fit: Any) -> Any:
        """Sizes from before a recording that half of the healthy ones show, of ``SHOWN``."""
        errors = size_errors(fit.law, fit.columns, self.design.faults, self.runs)
        limit = math.sqrt(2.0 * limit_nats(RATE, len(self.design.faults)))
        return limit * np.median(errors.before[:, self.places], axis=0)

    def largest(self, fit: Any, run: Any, onset: int = 0) -> Any:
        """Evidence for each fault alone, nats, by a law, shape (faults,); wrong signs count 0."""
        faults, law = self.design.faults, fit.law
        own = fit.columns.of(run)
        white = law.law_noise.whitened(run, np.concatenate((own, faults.of(run, onset)), axis=-1))
        count = own.shape[-1]
        rough = RunSums.of(white).first(count)
        spread = law.spread()
        total = np.diag(spread.variance) + spread.covariance
        first = np.linalg.solve(
            rough.gram + np.linalg.inv(9.0 * total), rough.beside(law.mean).cross
        )
        sums = RunSums.of(white.bounded(np.append(law.mean + first, np.zeros(len(faults)))))
        sums = sums.beside(np.append(law.mean, np.zeros(len(faults))))
        kept = np.linalg.inv(np.linalg.inv(total) + sums.gram[:count, :count])
        mixed = sums.gram[count:, :count]
        gain = np.diag(sums.gram[count:, count:] - mixed @ kept @ mixed.T)
        pull = sums.cross[count:] - mixed @ kept @ sums.cross[:count]
        size = pull / np.maximum(gain, 1e-300)
        feigned = np.array([row.begun_sigma if onset else row.claim_sigma for row in law.feigned])
        error = 1.0 / np.maximum(gain, 1e-300) + np.square(feigned)
        low = np.array([c.low for c in faults.columns])
        return np.where((size < 0.0) & (low >= 0.0), 0.0, 0.5 * size**2 / error)


def growing(
    stand: Stand, seed: int, orders: int, counts: tuple[int, ...], of: str = ""
) -> Iterator[Figure]:
    """Laws of more and more recordings."""
    rng = np.random.default_rng(seed)
    limit = limit_nats(RATE, len(stand.design.faults))
    chosen = [rng.permutation(len(stand.runs)) for _ in range(orders)]
    for count in counts:
        sizes, alarms, judged, named, sound = [], 0, 0, 0, 0
        for order in chosen[: 1 if count >= len(stand.runs) else orders]:
            fit = stand.design.learned([stand.runs[k] for k in order[:count]])
            sizes.append(stand.sizes(fit))
            named, sound = named + len(fit.unsound), sound + count
            for k in order[count:]:
                alarms += float(stand.largest(fit, stand.runs[k]).max()) > limit
                judged += 1
        found = np.array(sizes)
        for k, place in enumerate(stand.places):
            column = stand.design.faults.columns[place]
            yield Figure(f"{of}{column.name} from before, {count} recordings", found[:, k].mean(),
                         column.unit, len(found), found[:, k].min(), found[:, k].max())  # fmt: skip
        yield share(f"{of}{count} recordings: a left-out healthy one alarms", alarms, judged)
        yield share(f"{of}{count} recordings: a sound one is named unsound", named, sound)


def spoilt(stand: Stand, draws: int) -> Iterator[Figure]:
    """Unsound recordings among healthy ones."""
    rng = np.random.default_rng(SEED + 1)
    for kind, spoil in SPOILERS.items():
        named, odd, swallowed, wrong, sound = 0, 0, [], 0, 0
        for count, bad in SPOILT:
            for _ in range(draws):
                order = rng.permutation(len(stand.runs))[:count]
                healthy = [stand.runs[k] for k in order[bad:]]
                unsound = spoil(stand, [stand.recordings[k] for k in order[:bad]], rng)
                fit = stand.design.learned([*healthy, *unsound])
                places = {row.place for row in fit.unsound}
                missed = [k for k in range(len(healthy), count) if k not in places]
                named, odd = named + bad - len(missed), odd + bad
                wrong, sound = wrong + len(places) - bad + len(missed), sound + len(healthy)
                if missed:
                    clean = stand.sizes(stand.design.learned(healthy))
                    swallowed.append(float((stand.sizes(fit) / clean).max()))
        yield share(f"{kind}: named", named, odd)
        yield share(f"{kind}: a sound one named", wrong, sound)
        if swallowed:
            yield Figure(f"{kind}: largest size beside the clean one where one is missed",
                         max(swallowed), "1", len(swallowed))  # fmt: skip


def _lying(channel: str, change: Callable[[Any, Any], Any]) -> Callable[..., list[Any]]:
    def spoil(stand: Stand, recordings: list[Any], rng: Any) -> list[Any]:
        return [stand.windows(stand.changed(r, channel, change, 0)) for r in recordings]

    return spoil


def _slipping(y: Any, t: Any) -> Any:
    """For 0.6 s of every 2 s the nut follows by 0.3 of the way."""
    way = np.where(np.mod(t, 2.0) < 0.6, 0.3, 1.0)
    return y[0] + np.cumsum(np.diff(y, prepend=y[0]) * way)


SPOILERS: dict[str, Callable[..., list[Any]]] = {
    "jam": lambda stand, r, rng: [
        stand.jams[k] for k in rng.permutation(len(stand.jams))[: len(r)]
    ],
    "another unit": lambda stand, r, rng: [
        stand.others[k] for k in rng.permutation(len(stand.others))[: len(r)]
    ],
    "load cell dead": _lying("load_force", lambda y, t: np.full_like(y, y[0])),
    "current reads 0.5 A too much": _lying("motor_current", lambda y, t: y + 0.5),
    "load cell reads half": _lying("load_force", lambda y, t: 0.5 * y),
    "motor thermocouple drifts by 0.2 K/s": _lying("motor_temperature", lambda y, t: y + 0.2 * t),
    "coupling slips": _lying("actuator_position", _slipping),
}


def sizes(stand: Stand, folder: Path) -> Iterator[Figure]:
    """Said size against found size."""
    every = stand.design.learned(stand.runs)
    limit = limit_nats(RATE, len(stand.design.faults))
    law = stand.design.with_sizes(every, stand.calibration, stand.recordings)
    said = {row.fault: row for row in law.visible if row.fault in ERRORS and row.size != "level"}
    laws = [stand.design.learned([r for r in stand.runs if r is not run]) for run in stand.runs]
    target = folder / "calibration.yaml"
    write_calibration(target, stand.calibration)
    rng = np.random.default_rng(SEED + 2)
    chosen = rng.permutation(len(stand.runs))[:DIAGNOSED]
    within = {"law": 0, "diagnosis": 0}
    for fault, (channel, change) in ERRORS.items():
        row = said[fault]
        place = next(k for k, c in enumerate(stand.design.faults.columns)
                     if (c.fault, c.size) == (row.fault, row.size))  # fmt: skip
        by_law = half([
            np.mean([
                _seen_by_law(stand, laws[k], k, channel, change, step * row.onset, place) > limit
                for k in range(len(stand.runs))
            ])
            for step in STEPS
        ])  # fmt: skip
        by_limits = half([
            np.mean([
                _diagnosed(stand, k, channel, change, step * row.limits, target) for k in chosen
            ])
            for step in STEPS
        ])  # fmt: skip
        for who, ratio, size in (("law", by_law, row.onset), ("diagnosis", by_limits, row.limits)):
            within[who] += 1 / 1.5 <= ratio <= 1.5
            yield Figure(f"{fault}, {who}: found beside said {size:.3g} {row.unit}", ratio, "1",
                         len(STEPS) * (len(stand.runs) if who == "law" else DIAGNOSED))  # fmt: skip
    for who, right in within.items():
        yield share(f"{who}: found within 1.5 of said", right, len(ERRORS))


def half(shares: list[float]) -> float:
    """Step at which half are found, by interpolation of logarithms; ``BEYOND``: at none."""
    for k, found in enumerate(shares):
        if found >= 0.5:
            if k == 0:
                return STEPS[0]
            part = (0.5 - shares[k - 1]) / (found - shares[k - 1])
            low, high = math.log(STEPS[k - 1]), math.log(STEPS[k])
            return math.exp(low + part * (high - low))
    return BEYOND


def _seen_by_law(
    stand: Stand, fit: Any, k: int, channel: str, change: Any, size: float, place: int
) -> float:
    recording = stand.recordings[k]
    at = int(BEFORE * len(recording.run.rows))
    run = stand.windows(stand.changed(recording, channel, lambda y, t: change(y, t, size), at))
    onset = round(at * stand.calibration.period_s / 0.2)
    followed = run.part(slice(0, onset + round(FOLLOWED_S / 0.2)))
    return float(stand.largest(fit, followed, onset)[place])


def _diagnosed(
    stand: Stand, k: int, channel: str, change: Any, size: float, calibration: Path
) -> bool:
    """Whether the diagnosis detects it within the time that is followed."""
    recording = stand.recordings[k]
    at = int(BEFORE * len(recording.run.rows))
    changed = stand.changed(recording, channel, lambda y, t: change(y, t, size), at)
    period_s = stand.calibration.period_s
    until = at + round(FOLLOWED_S / period_s)
    channels = stand.calibration.channels
    rows = changed.run.rows[:until, [stand.index[name] for name in channels]]
    stamps = np.arange(len(rows), dtype=np.int64) * round(period_s * 1e9) + 1
    units = stand.design.work.effects().residuals.units
    rows_of = (ChannelInfo(name, units[name], -1e9, 1e9, 1.0 / period_s) for name in channels)
    table = ChannelTable(1, "flea", tuple(rows_of))
    stage = make_pipeline(load_stand(calibration=str(calibration)))
    done = diagnose((table, *ScanBlock(stamps, channels, rows).records()), stage)
    return any(isinstance(r, AmbiguityGroup) and r.episode > 0 for r in done.kept)


def main() -> int:
    """Run and print."""
    parser = bench_parser(__doc__)
    parser.add_argument("--part", action="append", choices=("growing", "spoilt", "sizes"))
    parser.add_argument("--draws", type=int, default=5, help="draws of each row of spoilt")
    arguments = parser.parse_args()
    parts = arguments.part or ("growing", "spoilt", "sizes")
    figures: list[Figure] = []
    with TemporaryDirectory() as folder:
        stand = Stand.real(Path(folder, "bags"))
        runs = {
            "growing": lambda: growing(stand, SEED, ORDERS, COUNTS),
            "spoilt": lambda: spoilt(stand, arguments.draws),
            "sizes": lambda: sizes(stand, Path(folder)),
        }
        for part in parts:
            for figure in runs[part]():
                spread = "" if figure.low is None else f" ({figure.low:.4g} to {figure.high:.4g})"
                print(f"{figure.name}: {figure.value:.4g} {figure.unit}{spread}, n = {figure.n}",
                      flush=True)  # fmt: skip
                figures.append(figure)
    write_summary("law", figures, arguments.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
