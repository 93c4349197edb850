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

"""Units that wear out: when growth is shown, how well the end is foretold, and what progpy says.

python bench/faults/remaining_life.py measure sizes.json          8 units of each kind of wear
python bench/faults/remaining_life.py score sizes.json --json FILE

``measure`` simulates units of their own, as new and then with a fault that grows from recording to
recording. A unit has one motion, that of its test; each recording has a load, a room and noise of
its own. Kept are the sizes that ``flea trend --fault`` finds. ``score`` foretells the end of each
after every recording. It does so besides for 100 units whose sizes are drawn with errors like
those: 40 recordings from the first with a fault to its end, and 8, each law in turn. The fault
grows from 5 to 25 % of the limit; the first forecast is that after the first recording in which
growth is shown. Where progpy is installed it foretells the drawn units as well, with an unscented
Kalman filter that is told by which law they grow.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from robustness.healthy import drawn_motion, scenario
from summary import Figure, bench_parser, share, write_summary

from flea_diag.configuration.calibrations import learned
from flea_diag.configuration.component import make_observer
from flea_diag.configuration.knowledge import knowledge
from flea_diag.configuration.stand import load_stand
from flea_diag.core.likelihood.fit import SizeError
from flea_diag.core.prognosis.forecast import GAIN, SHARES, forecast
from flea_diag.core.prognosis.growth_law import LAWS, GrowthLaw
from flea_diag.core.prognosis.scores import Foretold, at_lambda, horizon_s
from flea_diag.core.prognosis.size_series import SizeSeries, against_new
from flea_diag.core.prognosis.trend import trend
from flea_diag.stages.sizes.all_sizes import AllSizes
from flea_diag.tools.evaluate.case_run import in_blocks
from flea_diag.tools.replay.replay import diagnosed
from flea_diag.wire.records import Truth
from flea_sim_driver.machine.library import find_machine
from flea_sim_driver.stand import SimulatedStand

SCORED_SEED = 7600
NEW, LIVED, DRAWN, FEW = 3, 16, 40, 8
"""Recordings of a unit as new, of its wear as simulated, and as drawn, many and few."""
MOST_BESIDE = 10
"""Forecasts of a life of many recordings that progpy is asked for."""
RECORDED_S, BEGINS, ALPHA, HALF = 40.0, (0.05, 0.25), 0.2, 0.5


@dataclass(frozen=True)
class Wear:
    """A fault of a machine, the size that is followed, and its limit in the simulator's unit.

    One of the simulator's sizes is as much as the value ``of`` the unit, by its name; empty: 1.
    ``under``: a load of each recording's own (``drawn``), the same in all of a unit but for 2 %
    (``like``), or one that reverses (``swing``). Impacts are in m/s^2, of which the simulator knows
    nothing: their limit is what ``AT_LIMIT`` further recordings of the unit say at the limit.
    """

    machine: str
    fault: str
    size: str
    of: str
    limit: float
    laws: tuple[GrowthLaw, ...]
    under: str = "drawn"


LINEAR, EXPONENTIAL, PARIS = LAWS
IMPACTS = "impacts at the nut line"
AT_LIMIT = 4
WEARS = (
    Wear(
        "flea",
        "winding_short",
        "resistance lost",
        "winding_resistance_ohm",
        0.4,
        (LINEAR, EXPONENTIAL),
    ),
    Wear("ema", "magnet_loss", "strength lost", "", 0.2, (LINEAR, EXPONENTIAL)),
    Wear(
        "ema",
        "ball_nut_friction",
        "viscous drag",
        "viscous_friction_n_s_m",
        4.0,
        (LINEAR, EXPONENTIAL),
    ),
    Wear(
        "gimbal",
        "bearing_friction",
        "viscous drag",
        "viscous_friction_n_s_m",
        4.0,
        (LINEAR, EXPONENTIAL),
    ),
    Wear("flea", "spall", IMPACTS, "", 0.8, (PARIS, EXPONENTIAL), "like"),
    Wear("ema", "backlash", "play", "", 1e-3, (LINEAR, EXPONENTIAL), "swing"),
)
"""The rheostat of the paper, demagnetisation, drying grease, a worn bearing, a pit and play."""


@dataclass(frozen=True)
class Life:
    """Sizes of one unit, as new and worn, with the end of its life; times in recordings."""

    kind: str
    law: str
    limit: float
    end: float
    new: SizeSeries
    worn: SizeSeries


class Unit:
    """One simulated unit of a kind of wear, with the motion and load of its test."""

    def __init__(self, wear: Wear, draw: np.random.Generator) -> None:
        self.wear, self._draw = wear, draw
        self._machine, self._stand = find_machine(wear.machine), load_stand(wear.machine)
        known = knowledge(self._stand, learned(self._stand))
        self._sized = AllSizes(known, wear.fault, self._stand.kinematics.orders())
        self._same: dict[str, Any] = {
            "duration_s": RECORDED_S,
            "unit_seed": int(draw.integers(2**31)),
            "motion": drawn_motion(draw, self._machine),
        }
        self._load_n = 0.0
        if wear.under != "drawn":
            self._same["sensors"] = {"vibration": wear.size == IMPACTS}
            self._load_n = float(draw.uniform(0.2, 0.9)) * self._machine.limits.load_n
        healthy = SimulatedStand(self._scenario({}))
        self.each = float(getattr(healthy.units[healthy.unit_in_use], wear.of, 1.0))

    @property
    def nominal(self) -> float:
        """What one of the simulator's sizes is, of the design."""
        return float(getattr(self._machine.unit, self.wear.of, 1.0))

    def _scenario(self, fault: dict[str, Any]) -> Any:
        given = {**self._same, **fault}
        if self.wear.under == "like":
            share = 1.0 + 0.02 * float(self._draw.normal())
            given["load"] = {"constant_n": round(share * self._load_n, 1)}
        elif self.wear.under == "swing":
            swing = {"amplitude_n": round(self._load_n, 1), "frequency_hz": 0.1}
            given["load"] = {"constant_n": 0.0, **swing}
        return scenario(self._draw, "as calibrated", self._machine, self.wear.machine, given)

    def rows(self, time: float, size: float) -> list[dict[str, Any]]:
        """What a recording at a time, with a fault of this size, says."""
        fault = {"fault": self.wear.fault, "onset_s": 0.0, "size": size / self.each}
        made = self._scenario({"faults": [fault] if size else []})
        records = (r for r in SimulatedStand(made) if not isinstance(r, Truth))
        self._sized.begin()
        given: Any = records
        if self.wear.size != IMPACTS:  # these need no relation
            # Play of any size is detected, and from then on a block is no faster than its scans.
            taken = records if self.wear.under == "swing" else in_blocks(records)
            given = diagnosed(taken, make_observer(self._stand))
        for record in given:
            self._sized.add(record)
        found = [row for row in self._sized.sizes() if row.of.name == self.wear.size]
        return [
            {"time": time, "truth": size, "size": row.size, "own": row.error.own,
             "from_unit": row.error.from_unit}
            for row in found
        ]  # fmt: skip


def measured(wear: Wear, number: int, seed: int) -> dict[str, Any]:
    """One unit through simulator and observer."""
    draw = np.random.default_rng((seed, WEARS.index(wear), number))
    law = wear.laws[number % len(wear.laws)]
    end = float(draw.uniform(0.8, 1.0)) * LIVED
    begins = float(draw.uniform(*BEGINS))
    unit = Unit(wear, draw)
    limit = wear.limit * unit.nominal
    low, high = law.straight(limit * begins), law.straight(limit)
    rows: list[dict[str, Any]] = []
    for time in np.arange(-NEW, int(end) + 1).tolist():
        size = float(law.size(low + time / end * (high - low))) if time >= 0 else 0.0
        rows += unit.rows(time, size)
    if wear.size == IMPACTS:
        at_limit = [row["size"] for _ in range(AT_LIMIT) for row in unit.rows(end, limit)]
        as_new = [row["size"] for row in rows if row["time"] < 0]
        limit = float(np.mean(at_limit) - np.mean(as_new))
    kind = f"{wear.machine}: {wear.fault}"
    return {"kind": kind, "law": law.name, "limit": limit, "end": end, "rows": rows}


def life_of(unit: dict[str, Any]) -> Life:
    """A unit as it was measured."""

    def series(rows: Sequence[dict[str, Any]]) -> SizeSeries:
        errors = [SizeError(row["own"], tuple(row["from_unit"])) for row in rows]
        return SizeSeries.of([r["time"] for r in rows], [r["size"] for r in rows], errors)

    new = [row for row in unit["rows"] if row["time"] < 0]
    worn = [row for row in unit["rows"] if row["time"] >= 0]
    return Life(unit["kind"], unit["law"], unit["limit"], unit["end"], series(new), series(worn))


def drawn(number: int, own: float, shared: float, seed: int, count: int) -> Life:
    """A unit whose sizes are drawn; own and shared errors in shares of the limit."""
    draw, law = np.random.default_rng((seed + number, count)), LAWS[number % len(LAWS)]
    end, unit = float(draw.uniform(0.8, 1.0)) * count, float(draw.normal())
    low, high = law.straight(draw.uniform(*BEGINS)), law.straight(1.0)
    times = np.arange(-NEW, int(end) + 1)
    sizes = np.where(times < 0, 0.0, law.size(low + np.maximum(times, 0) / end * (high - low)))
    gain = 1.0 + GAIN * float(draw.normal())
    found = gain * sizes + own * draw.normal(size=len(times)) + shared * unit
    every = SizeSeries.of(times.tolist(), found.tolist(), [SizeError(own, (shared,))] * len(times))
    return Life("drawn", law.name, 1.0, end, every.part(slice(NEW)), every.part(slice(NEW, None)))


def foretold(life: Life, laws: Sequence[GrowthLaw] = LAWS) -> tuple[list[Foretold], float | None]:
    """Forecasts after each recording from which on growth was shown, and when that was."""
    worn, made, shown = against_new(life.worn, life.new), [], None
    for count in range(2, len(worn) + 1):
        so_far = worn.part(slice(count))
        if shown is None and trend(so_far).direction != "grows":
            continue
        time = float(so_far.times[-1])
        shown = time if shown is None else shown
        found = forecast(so_far, laws)
        if found is not None and time < life.end:
            end = found.crossing(life.limit)
            made.append(Foretold(time, end.low_s, end.median_s, end.high_s))
    return made, shown


def by_progpy(life: Life, seed: int, until: int) -> Foretold:
    """The forecast of progpy's unscented Kalman filter after so many recordings, told the law."""
    from progpy import PrognosticsModel
    from progpy.predictors import MonteCarlo
    from progpy.state_estimators import UnscentedKalmanFilter
    from progpy.uncertain_data import MultivariateNormalDist

    np.random.seed(seed)  # noqa: NPY002 (progpy draws from the generator of the process)
    law = next(law for law in LAWS if law.name == life.law)
    worn = against_new(life.worn, life.new).part(slice(until))
    limit, own = life.limit, float(np.median(worn.own))

    class Growth(PrognosticsModel):  # type: ignore[misc]
        states, outputs, events = ["size", "rate"], ["size"], ["limit"]
        default_parameters = {  # noqa: RUF012 (as progpy asks for it)
            "x0": {"size": 0.0, "rate": 0.0}, "process_noise": 0.0,
        }  # fmt: skip

        def dx(self, x: Any, _u: Any) -> Any:
            grown = x["rate"] * np.maximum(x["size"], 1e-6 * limit) ** law.power
            return self.StateContainer({"size": grown, "rate": 0.0 * x["rate"]})

        def output(self, x: Any) -> Any:
            return self.OutputContainer({"size": x["size"]})

        def event_state(self, x: Any) -> Any:
            return {"limit": 1.0 - x["size"] / limit}

        def threshold_met(self, x: Any) -> Any:
            return {"limit": x["size"] >= limit}

    model = Growth(measurement_noise={"size": own}, process_noise=0.0)
    first = max(float(worn.sizes[0]), own)
    last = max(float(worn.sizes[-1]), 2.0 * own)
    rate = float(law.straight(max(last, first + own)) - law.straight(first)) / float(worn.times[-1])
    start = MultivariateNormalDist(
        ["size", "rate"], [first, rate], np.diag([own**2, rate**2])
    )  # fmt: skip
    # Its own default noises are of no scale; these let it follow, and tell it the true one.
    known = UnscentedKalmanFilter(
        model, start, Q=np.diag([(0.1 * own) ** 2, (0.01 * rate) ** 2]), R=np.diag([own**2])
    )
    for time, size in zip(worn.times[1:].tolist(), worn.sizes[1:].tolist(), strict=True):
        known.estimate(time, model.InputContainer({}), model.OutputContainer({"size": size}))
    made_at = float(worn.times[-1])
    result = MonteCarlo(model).predict(
        known.x, lambda _t, _x=None: model.InputContainer({}), t0=made_at, dt=0.5,
        n_samples=50, horizon=made_at + 3.0 * life.end, events=["limit"],
    )  # fmt: skip
    ends = [e["limit"] for e in result.time_of_event]
    times = np.array([np.inf if end is None else end for end in ends], dtype=float)
    return Foretold(made_at, *np.quantile(times, SHARES, method="inverted_cdf").tolist())


def scored(lives: Sequence[Life], name: str) -> list[Figure]:
    """Shares of the units, and of all forecasts."""
    right, covered, every, horizons, shown_at, lates = 0, 0, [], [], [], []
    for number, life in enumerate(lives):
        made, shown = foretold(life)
        half = None if shown is None else at_lambda(made, shown, life.end, HALF)
        good = half is not None and half.is_within(life.end, ALPHA)
        right += good
        covered += half is not None and half.covers(life.end)
        every += [each.covers(life.end) for each in made]
        horizons.append(horizon_s(made, life.end, ALPHA, life.end) / life.end)
        shown_at.append(np.inf if shown is None else shown / life.end)
        if not good:
            said = "none" if half is None else f"{half.median_s:.1f} after {half.made_s:g}"
            lates.append(f"{number} {life.law}: {said}, end {life.end:.1f}")
    n = len(lives)
    print(f"{name}: missed {'; '.join(lates) or 'none'}", flush=True)
    return [
        share(f"{name}: alpha {ALPHA:g} at lambda {HALF:g}", right, n),
        share(f"{name}: end within 90 % at lambda {HALF:g}", covered, n),
        share(f"{name}: end within 90 %, all forecasts", sum(every), len(every)),
        Figure(f"{name}: horizon, median", 100.0 * float(np.median(horizons)), "% of life", n),
        Figure(f"{name}: growth shown at, median", 100.0 * float(np.median(shown_at)), "% of life",
               n),
    ]  # fmt: skip


def third_recording(own: float, shared: float, seed: int, count: int) -> list[Figure]:
    """Growth in steps of two own errors, and none: whether it is shown by the third recording."""
    draw = np.random.default_rng((seed, 200))
    found = []
    for step in (2.0, 0.0):
        grows = 0
        for _ in range(count):
            unit = shared * float(draw.normal())
            sizes = own * (step * np.arange(3) + draw.normal(size=3)) + unit
            series = SizeSeries.of([0.0, 1.0, 2.0], sizes.tolist(), [SizeError(own, (shared,))] * 3)
            grows += trend(series).direction == "grows"
        found.append(
            share(f"growth shown by the third, steps of {step:g} own errors", grows, count)
        )
    return found


def beside(lives: Sequence[Life], name: str, seed: int) -> list[Figure]:
    """Our and progpy's forecasts of the same units after the same recordings, told the law."""
    ours: list[list[Foretold]] = []
    theirs: list[list[Foretold]] = []
    for number, life in enumerate(lives):
        made, _ = foretold(life, [law for law in LAWS if law.name == life.law])
        made = made[:: max(len(made) // MOST_BESIDE, 1)]
        ours.append(made)
        theirs.append([by_progpy(life, seed + number, 1 + int(each.made_s)) for each in made])
    figures = []
    for who, every in (("flea_diag", ours), ("progpy", theirs)):
        halves = [
            at_lambda(made, made[0].made_s, life.end, HALF) if made else None
            for made, life in zip(every, lives, strict=True)
        ]
        pairs = list(zip(halves, lives, strict=True))
        right = sum(half is not None and half.is_within(of.end, ALPHA) for half, of in pairs)
        held = [f.covers(of.end) for made, of in zip(every, lives, strict=True) for f in made]
        horizons = [
            horizon_s(made, of.end, ALPHA, of.end) / of.end
            for made, of in zip(every, lives, strict=True)
        ]
        told = f"{name}, law known, {who}"
        figures += [
            share(f"{told}: alpha {ALPHA:g} at lambda {HALF:g}", right, len(lives)),
            share(f"{told}: end within 90 %, all forecasts", sum(held), len(held)),
            Figure(f"{told}: horizon, median", 100.0 * float(np.median(horizons)), "% of life",
                   len(lives)),
        ]  # fmt: skip
    return figures


def main() -> int:
    """Measure, or score and print."""
    parser = bench_parser(__doc__)
    parser.add_argument("what", choices=("measure", "score"))
    parser.add_argument("sizes", type=Path, help="file of the measured sizes")
    parser.add_argument("--units", type=int, default=8, help="of each kind of wear")
    parser.add_argument("--kind", nargs="+", help="of these faults alone, by their names")
    parser.add_argument("--drawn", type=int, default=100, help="units whose sizes are drawn")
    parser.add_argument("--seed", type=int, default=SCORED_SEED)
    arguments = parser.parse_args()
    if arguments.what == "measure":
        units = []
        for number in range(arguments.units):
            for wear in WEARS:
                if arguments.kind and wear.fault not in arguments.kind:
                    continue
                units.append(measured(wear, number, arguments.seed))
                arguments.sizes.write_text(json.dumps(units), encoding="utf-8")
                print(f"{units[-1]['kind']}, unit {number}", flush=True)
        return 0
    lives = [life_of(unit) for unit in json.loads(arguments.sizes.read_text(encoding="utf-8"))]
    figures: list[Figure] = []
    for kind in dict.fromkeys(life.kind for life in lives):
        figures += scored([life for life in lives if life.kind == kind], kind)
    figures += scored(lives, "simulated")
    own = float(np.median(np.concatenate([life.worn.own / life.limit for life in lives])))
    shared = float(np.median([
        np.hypot.reduce(life.worn.from_unit, axis=1).max() / life.limit for life in lives
    ]))  # fmt: skip
    print(f"errors in shares of the limit, medians: own {own:.4f}, of the unit {shared:.4f}")
    figures += third_recording(own, shared, arguments.seed, 1000)
    for count in (DRAWN, FEW):
        made = [drawn(k, own, shared, arguments.seed, count) for k in range(arguments.drawn)]
        name = f"drawn, {count} recordings a life"
        figures += scored(made, name)
        try:
            figures += beside(made, name, arguments.seed)
        except ImportError:
            print("progpy is not installed: no comparison")
    for figure in figures:
        print(f"{figure.name}: {figure.value:.1f} {figure.unit} of {figure.n}")
    write_summary("bench/faults/remaining_life.py", figures, arguments.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
