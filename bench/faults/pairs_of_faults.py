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

"""Pairs of faults, at once and 8 s apart, beside each of their members alone.

python bench/faults/pairs_of_faults.py               30 pairs of each machine
python bench/faults/pairs_of_faults.py 5 --machine ema --seed 4400

Two faults are drawn from the catalogue with sizes by the machine's own. A pair counts where each
member alone is detected and in its last group, and where both act differently on the relations.
``masked``: one of both keeps motion, current or the very reading of the other away, or is a dead
reading that each relation which the other moves holds: the verdict on it alone says that it hides
the other. Both are named where the last verdict holds both in a set of at most four names.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from summary import Figure, bench_parser, share, write_summary

from flea_diag.configuration.calibrations import learned
from flea_diag.configuration.component import make_pipeline
from flea_diag.configuration.knowledge import knowledge
from flea_diag.configuration.stand import Stand, load_stand
from flea_diag.core.likelihood.fault_models import FaultModel
from flea_diag.core.likelihood.isolability import isolable
from flea_diag.stages.isolator.pairs.masking import Masking
from flea_diag.tools.evaluate.case_run import diagnose
from flea_diag.wire.records import AmbiguityGroup, ChannelTable, Outcome, Record, Scan
from flea_sim_driver.faults import catalogue
from flea_sim_driver.machine.library import find_machine
from flea_sim_driver.scenario.library import find_scenario
from flea_sim_driver.scenario.scenario import Scenario
from flea_sim_driver.scenario.settings import FaultSetting
from flea_sim_driver.stand import SimulatedStand

SCORED_SEED = 4500
MACHINES = ("flea", "ema", "wing")
MOTIONS = ("nominal_loaded", "nominal_pulled", "nominal_trapezoid")
ONSET_S, APART_S, DURATION_S = 12.0, 8.0, 44.0
MOST = 4
"""Names in a set that says something."""
STOPPING = ("winding_open", "motor_failure", "supply_open", "supply_short")
"""Faults after which no current flows and nothing moves by itself."""
SIGNED = ("bias", "drift")
HIDDEN = "hidden by "
"""How the reason begins why a fault is not observable beside a dead reading."""


def scenario(
    machine: str, seed: int, motion: str, lasts_s: float, *faults: FaultSetting
) -> Scenario:
    """A run of a machine in one of its motions."""
    found = find_scenario(motion, machine)
    run = replace(found.run, seed=seed, duration_s=lasts_s)
    return replace(found, run=run, sensors=replace(found.sensors, vibration=False), faults=faults)


@dataclass(frozen=True)
class Pair:
    """Two faults of one run, and when the second one begins."""

    machine: str
    seed: int
    motion: str
    faults: tuple[FaultSetting, FaultSetting]

    @property
    def names(self) -> tuple[str, str]:
        """Faults of both."""
        first, second = self.faults
        return first.fault, second.fault

    @property
    def is_masked(self) -> bool:
        """Whether one of both keeps what the other needs to show away."""
        one, other = self.names
        shared = one.rpartition("_")[0] == other.rpartition("_")[0]
        return (
            one in STOPPING
            or other in STOPPING
            or ("dead" in one + other and shared)
            or other in hidden_by(self.machine, one)
            or one in hidden_by(self.machine, other)
        )

    def scenario(self, *which: int) -> Scenario:
        """The run with these of both faults."""
        faults = (self.faults[k] for k in which)
        return scenario(self.machine, self.seed, self.motion, DURATION_S, *faults)


@dataclass(frozen=True)
class Told:
    """What a run ended with."""

    outcome: Outcome
    names: tuple[str, ...]
    detected_s: float
    words: str
    hidden: frozenset[str]

    @property
    def is_certain(self) -> bool:
        """Whether one name is given as the fault."""
        return self.outcome is Outcome.ISOLATED and len(self.names) == 1

    def has_both(self, pair: Pair) -> bool:
        """Whether both are in a set of few names."""
        return set(pair.names) <= set(self.names) and len(self.names) <= MOST


@cache
def known(machine: str) -> tuple[Stand, tuple[str, ...], tuple[FaultModel, ...]]:
    """Stand, faults of catalogue and machine alike that relations show, and their models."""
    stand = load_stand(machine)
    calibration = learned(stand)
    effects = knowledge(stand, calibration).effects
    models = effects.bound(calibration.parameters)
    modelled = {model.fault for model in models if model.terms}
    rows = catalogue(find_machine(machine))
    return stand, tuple(name for name in rows if name in modelled and name != "spall"), models


@cache
def hidden_by(machine: str, name: str) -> frozenset[str]:
    """Faults that the verdict says a dead reading hides; none of any other fault."""
    stand, _, models = known(machine)
    masking = Masking(knowledge(stand, learned(stand)), models)
    return frozenset(fault for fault, _ in masking.hidden([(name,)]))


def drawn(machine: str, seed: int, apart_s: float) -> Pair:
    """A pair of faults that no set of relations takes for one another."""
    _, names, models = known(machine)
    draw = np.random.default_rng(seed)
    relations = {term.residual for model in models for term in model.terms}
    rows = catalogue(find_machine(machine))
    while True:
        one, other = (names[k] for k in draw.choice(len(names), 2, replace=False))
        if isolable(models, (one, other), relations):
            break
    faults = []
    for name, onset_s in ((one, ONSET_S), (other, ONSET_S + apart_s)):
        row, factor = rows[name], draw.uniform(0.9, 1.6)
        sign = -1.0 if row.mode in SIGNED and draw.random() < 0.5 else 1.0
        size = 1.0 + (row.default_size - 1.0) * factor if row.mode == "scaling" else (
            sign * row.default_size * factor)  # fmt: skip
        size = min(max(size, row.minimum), row.maximum)
        faults.append(FaultSetting(name, onset_s, size))
    motion = MOTIONS[int(draw.integers(len(MOTIONS)))]
    return Pair(machine, seed, motion, (faults[0], faults[1]))


def records(scenario: Scenario) -> list[Record]:
    """What the diagnosis gets of a run."""
    return [r for r in SimulatedStand(scenario) if isinstance(r, (ChannelTable, Scan))]


def verdicts(stand: Stand, recorded: list[Record]) -> list[AmbiguityGroup]:
    """All that is said of it."""
    kept = diagnose(iter(recorded), make_pipeline(stand)).kept
    return [record for record in kept if isinstance(record, AmbiguityGroup)]


def told(stand: Stand, recorded: list[Record]) -> Told:
    """Diagnose it."""
    first_ns = next(r.stamp_ns for r in recorded if isinstance(r, Scan))
    groups = verdicts(stand, recorded)
    opened = [g.detected_stamp_ns for g in groups if g.episode]
    last = groups[-1]
    names = tuple(member.fault for member in last.members)
    detected_s = (opened[0] - first_ns) / 1e9 if opened else -1.0
    hidden = frozenset(name for name, why in last.not_observable if why.startswith(HIDDEN))
    return Told(last.outcome, names, detected_s, last.words, hidden)


def judged(pair: Pair) -> tuple[bool, bool, Told]:
    """Whether each member alone is detected and named, whether it says that it hides the other.

    Then what both ended with.
    """
    stand = known(pair.machine)[0]
    is_masked = pair.is_masked
    for k, (name, fault) in enumerate(zip(pair.names, pair.faults, strict=True)):
        alone = told(stand, records(pair.scenario(k)))
        if alone.detected_s < fault.onset_s or name not in alone.names:
            return False, is_masked, alone
        is_masked = is_masked or pair.names[1 - k] in alone.hidden
    return True, is_masked, told(stand, records(pair.scenario(0, 1)))


def figures_of(found: list[tuple[Pair, Told]], kind: str) -> list[Figure]:
    """Shares of these pairs."""
    both = sum(each.has_both(pair) for pair, each in found)
    certain = sum(each.is_certain for _, each in found)
    return [
        share(f"{kind}: both in at most {MOST} names", both, len(found)),
        share(f"{kind}: one name with certainty", certain, len(found)),
    ]


def main() -> int:
    """Run and print."""
    parser = bench_parser(__doc__)
    parser.add_argument("pairs", nargs="?", type=int, default=30, help="of each machine")
    parser.add_argument("--seed", type=int, default=SCORED_SEED)
    parser.add_argument("--machine", choices=MACHINES, action="append")
    arguments = parser.parse_args()
    found: dict[str, list[tuple[Pair, Told]]] = {"masked": [], "at once": [], "8 s apart": []}
    for number in range(arguments.pairs):
        for machine in arguments.machine or MACHINES:
            seed = arguments.seed + 10 * number + MACHINES.index(machine)
            apart_s = APART_S * ((seed // 10) % 2)
            pair = drawn(machine, seed, apart_s)
            counts, is_masked, last = judged(pair)
            kind = "masked" if is_masked else "8 s apart" if apart_s else "at once"
            if counts:
                found[kind].append((pair, last))
            names = ", ".join(last.names) or "-"
            said = f"{last.outcome.name}: {names}" if counts else "not shown alone"
            print(f"{machine} {seed} {kind} {' and '.join(pair.names)} | {said}", flush=True)
    figures = [each for kind, rows in found.items() for each in figures_of(rows, kind)]
    for figure in figures:
        print(f"{figure.name}: {figure.value:.1f} % of {figure.n}")
    write_summary("bench/faults/pairs_of_faults.py", figures, arguments.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
