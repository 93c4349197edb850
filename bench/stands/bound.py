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

"""Information bound: what of each fault, at its smallest, the channels of a simulated machine hold.

python bench/stands/bound.py ema --json bound.json

It rests on the machine alone (config/machines) and on no decision of a diagnosis. On four motions
of the campaign (--seed) a healthy run is simulated, and the same run with each row's fault at its
smallest size. The difference D of the channels is held against what healthy running of that very
unit scatters by, and against what a unit may differ by:

    d^2 = D' (S + B B')^-1 D

S is the cross-spectrum of healthy runs that differ in their noise alone (rough loads, gusts,
instruments), so that what one channel says of another counts. The columns of B are finite
differences of the simulation in what is drawn of a unit, one standard deviation each. A fault is to
be had where d is at least ``LEAST``: a test that is silent for ten hours needs as much. Two faults
are partable where what no size of the other makes up of D is as large. It is optimistic: onset,
course and the unit's own healthy run are known to it, and what the description lacks is known, too.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import yaml

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from summary import ROOT, Figure, bench_parser, share, write_summary

from flea_diag.tools.campaign.campaign import load_campaign
from flea_diag.tools.campaign.case import plan
from flea_diag.tools.campaign.recording_set import RecordingSet
from flea_diag.wire.records import Scan
from flea_sim_driver.machine.machine import Machine
from flea_sim_driver.scenario.scenario_file import scenario_from_mapping
from flea_sim_driver.stand import SimulatedStand

Array = npt.NDArray[np.float64]
Values = dict[str, Any]

LEAST = 5.6
"""Deflection of a fault that is to be had: of a test that is silent for ten hours."""
HEALTHY, SMOOTHED, GROUP = 6, 15, 3
"""Further healthy runs whose scatter is the noise; neighbouring frequencies that share a
cross-spectrum; faults of a group."""
OUTSIDE = {
    "controller_gain": (0.5, 1.6),
    "slipping_gear": (0.03, 0.1),
    "second_load": (600.0, -600.0),
}
"""Faults that no catalogue has, and two sizes of each."""
DRAWN = ("ohm", "_n", "_a", "_m", "_kg", "_ratio", "_v", "wave")
"""Ends of the names of what is drawn of a unit and moves its signals within a run."""


def channels(scenario: Values, change: Mapping[str, float] | None = None) -> Array:
    """Scans of a run, shape (n, channels); ``change``: shares by which its unit is another."""
    stand = SimulatedStand(scenario_from_mapping(scenario, "bound"))
    for name, grown in (change or {}).items():
        unit = stand.units[stand.unit_in_use]
        changed = {name: getattr(unit, name) * (1.0 + grown)}
        stand.units[stand.unit_in_use] = replace(unit, **changed)
    return np.array([record.values for record in stand if isinstance(record, Scan)])


@dataclass(frozen=True)
class Noise:
    """What whitens the channels: of each frequency a root of its inverse cross-spectrum."""

    root: npt.NDArray[np.complex128]
    scale: Array

    @classmethod
    def of(cls, runs: Sequence[Array], machine: Machine) -> Noise:
        """From runs that differ in their noise alone, each of shape (n, channels)."""
        mean = np.mean(runs, axis=0)
        count = 2.0 * np.pi / machine.sampling.encoder_counts / machine.sampling.scan_s
        steps = [
            count if row.channel == "motor_speed" else max(row.resolution, 1e-9)
            for row in machine.instruments
        ]
        scale = np.array(steps) / np.sqrt(12.0)
        spectra = np.fft.rfft(np.array([(run - mean) / scale for run in runs]), axis=1)
        cross = np.einsum("rfa,rfb->fab", spectra, spectra.conj()) / (len(runs) - 1)
        flat = np.pad(cross.reshape(len(cross), -1), ((SMOOTHED // 2,) * 2, (0, 0)), "reflect")
        kernel = np.ones(SMOOTHED) / SMOOTHED
        smooth = np.array([np.convolve(column, kernel, "valid") for column in flat.T]).T
        # A reading that stands still is known to its resolution, not better.
        floor = len(mean) * np.eye(len(scale))
        root = np.linalg.inv(np.linalg.cholesky(smooth.reshape(cross.shape) + floor))
        return cls(root, scale)

    def white(self, difference: Array) -> Array:
        """A difference of runs in units of the noise: the square of its length is d^2."""
        spectrum = np.fft.rfft(difference / self.scale, axis=0)
        weight = np.full(len(spectrum), np.sqrt(2.0))
        weight[0] = weight[-1] = 1.0
        seen = np.einsum("fab,fb->fa", self.root, spectrum) * weight[:, None]
        return np.concatenate((seen.real.ravel(), seen.imag.ravel()))


class Run:
    """One motion of one unit: its healthy run, its noise, and what other units would differ by."""

    def __init__(self, scenario: Values) -> None:
        own = int(scenario.get("unit_seed", -1))
        own = own if own >= 0 else int(scenario["seed"])
        self.calm = {**scenario, "faults": [], "unit_seed": own}
        self.onset = {"onset_s": scenario["faults"][0]["onset_s"]}
        machine = scenario_from_mapping(self.calm, "bound").machine
        self._healthy = channels(self.calm)
        runs = [channels({**self.calm, "seed": 10**6 + number}) for number in range(HEALTHY)]
        self._noise = Noise.of(runs, machine)
        drawn = {name: size for name, size in machine.spread.items() if name.endswith(DRAWN)}
        parts = [channels(self.calm, {n: s}) - self._healthy for n, s in drawn.items()]
        for column, row in enumerate(machine.instruments):
            gain = np.zeros(len(machine.instruments))
            gain[column] = row.gain_spread
            parts += [self._healthy * gain] if row.gain_spread else []
        self._others = np.array([self._noise.white(part) for part in parts])
        self._known = np.eye(len(parts)) + self._others @ self._others.T

    def seen(self, fault: Values) -> Array:
        """What a fault changes, in units of the noise."""
        faulty = channels({**self.calm, "faults": [fault | self.onset]})
        return self._noise.white(faulty - self._healthy)

    def _inner(self, one: Array, other: Array) -> float:
        """One' (I + B B')^-1 other."""
        a, b = self._others @ one, self._others @ other
        return float(one @ other - a @ np.linalg.solve(self._known, b))

    def deflection(self, one: Array) -> float:
        """How far it stands out, in standard deviations."""
        return float(np.sqrt(max(self._inner(one, one), 0.0)))

    def apart(self, one: Array, other: Array) -> float:
        """What no size of the other makes up of it."""
        there = self._inner(other, other)
        size = max(self._inner(one, other) / there, 0.0) if there > 0.0 else 0.0
        return self.deflection(one - size * other)


def motions(machine: str, seed: int) -> list[Values]:
    """One faulty scenario of each kind of motion, of a unit of its own."""
    content = yaml.safe_load((ROOT / f"config/campaigns/{machine}.yaml").read_text("utf-8"))
    content["sources"] = [{**content["sources"][1], "seed": seed}]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{machine}.yaml"
        path.write_text(yaml.safe_dump(content), "utf-8")
        campaign = load_campaign(path)
        cases = plan(campaign, RecordingSet(campaign, Path(folder)))
        found = {c.recipe.scenario["motion"].get("kind", "sine"): c.recipe.scenario for c in cases
                 if c.recipe.scenario.get("faults")}  # fmt: skip
    return list(found.values())


def rows_of(machine: str) -> list[Values]:
    """Every row at its smallest sizes, both signs where it has two, and what is outside."""
    content = yaml.safe_load((ROOT / f"config/campaigns/{machine}.yaml").read_text("utf-8"))
    found: list[Values] = []
    for row in content["sources"][0]["rows"]:
        sizes = [row["low"]] if "low" in row else row.get("sizes", [None])[:2]
        sizes = [*sizes, *(-size for size in sizes if row.get("either_sign"))]
        given = [{} if size is None else {"size": size} for size in sizes]
        found += [{"fault": row["fault"]} | each for each in given if "fault" in row]
    return found + [{"fault": name, "size": s} for name, sizes in OUTSIDE.items() for s in sizes]


def judged(run: Run, faults: Sequence[Values]) -> list[tuple[str, float, set[str]]]:
    """Fault, deflection, and the catalogue's faults that it cannot be parted from."""
    seen = [(fault["fault"], run.seen(fault)) for fault in faults]
    found = []
    for name, one in seen:
        rivals = [(other, there) for other, there in seen if other not in (name, *OUTSIDE)]
        left = {other for other, there in rivals if run.apart(one, there) < LEAST}
        found.append((name, run.deflection(one), left))
        print(f"{name}: d {found[-1][1]:.1f}, not partable from {sorted(left)}", flush=True)
    return found


def figures_of(found: Sequence[tuple[str, float, set[str]]]) -> list[Figure]:
    """Of each fault its least deflection, and the share in which it can be named."""
    figures = []
    for name in dict.fromkeys(name for name, _, _ in found):
        mine = [(d, left) for each, d, left in found if each == name]
        least = min(d for d, _ in mine)
        figures.append(Figure(f"{name}: least d", least, "sigma", len(mine)))
        most = 0 if name in OUTSIDE else GROUP - 1
        words = "parted from every row" if name in OUTSIDE else f"in a group of at most {GROUP}"
        had = sum(d >= LEAST and len(left) <= most for d, left in mine)
        figures.append(share(f"{name}: {words}", had, len(mine)))
    return figures


def main() -> int:
    """Compute and print."""
    parser = bench_parser(__doc__)
    parser.add_argument("machine", choices=("ema", "wing"))
    parser.add_argument("--seed", type=int, default=972)
    given = parser.parse_args()
    found = []
    for scenario in motions(given.machine, given.seed):
        print(scenario["motion"], flush=True)
        found += judged(Run(scenario), rows_of(given.machine))
    figures = figures_of(found)
    for figure in figures:
        print(f"{figure.name}: {figure.value:.1f} {figure.unit}, n {figure.n}")
    write_summary(f"bench/stands/bound.py {given.machine}", figures, given.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
