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

"""A campaign as a list of runs, each a frozen recipe for its records.

The list depends on the campaign alone, so that an interrupted campaign continues with the same
runs in any process and on any machine.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from flea_diag.configuration.files import DEFAULT_STAND
from flea_diag.errors import ConfigurationError, shown
from flea_diag.tools.campaign.campaign import (
    CLASSIFIER,
    HALVES,
    HYBRID,
    Campaign,
    Drawn,
    FaultCases,
    Injections,
    Recordings,
    Scenarios,
    Switches,
)
from flea_diag.tools.campaign.recording_set import RecordedRun, RecordingSet
from flea_diag.tools.campaign.run_result import NOMINAL

PROFILE = re.compile(r"BatchProfile_([a-z]+\d\d)_")
"""Motion and load in the name of a FLEA run."""


@dataclass(frozen=True)
class Recipe:
    """How the records of a run are made; fields that do not apply stay empty.

    ``recording`` is a bag. ``faulty`` is the bag that a switch changes to. ``fault`` is the
    channel and mode of an injection, case ``number`` of ``seed``; ``size`` is the size of a
    ladder, None where it is drawn.
    """

    scenario: dict[str, Any] = field(default_factory=dict)
    recording: str = ""
    faulty: str = ""
    fault: str = ""
    size: float | None = None
    seed: int = 0
    number: int = 0
    margin_s: float = 0.0


@dataclass(frozen=True)
class Case:
    """One run to be evaluated: its row, its configuration and its calibration.

    For baselines that learn: ``learned_from`` are the nominal bags behind the calibration,
    ``classifier`` is a trained network.
    """

    id: str
    kind: str
    row: str
    recipe: Recipe
    configuration: str = HYBRID
    fold: str = ""
    stand: str = ""
    calibration: str = ""
    learned_from: tuple[str, ...] = ()
    classifier: str = ""

    @property
    def key(self) -> tuple[str, str, str]:
        """Unique key of the run, equal to the key of its result."""
        return self.id, self.configuration, self.fold


@dataclass(frozen=True)
class CampaignPlan:
    """Every run of a campaign, configuration after configuration, made anew for whoever asks.

    A run with its scenario takes 8 kB: as a list a million of them would fill 8 GB.
    """

    campaign: Campaign
    recordings: RecordingSet
    once: int
    """Runs of one configuration."""

    def __len__(self) -> int:
        """Runs of all configurations."""
        return self.once * len(self.campaign.configurations)

    def __iter__(self) -> Iterator[Case]:
        """The runs."""
        named = self.campaign.classifier
        classifier = str(self.campaign.folder / named) if named else ""
        stand = self.campaign.stand_path()
        nominal = _taught(self.campaign, self.recordings)
        for name in self.campaign.configurations:
            for case in _once(self.campaign, self.recordings):
                yield replace(
                    case,
                    configuration=name,
                    stand=stand,
                    learned_from=case.learned_from or nominal,
                    classifier=classifier if name == CLASSIFIER else "",
                )


def plan(campaign: Campaign, recordings: RecordingSet) -> CampaignPlan:
    """Every run of a campaign, each looked at once.

    Raises
    ------
    ConfigurationError
        A row or scenario cannot be run, or a pattern matches no recording.
    """
    seen: set[int] = set()
    count = 0
    for count, case in enumerate(_once(campaign, recordings), 1):
        seen.add(_fingerprint(case))
        if len(seen) < count:
            raise ConfigurationError(f"{campaign.name}: several runs are named {shown(case.id)}")
    if not count:
        raise ConfigurationError(f"{campaign.name}: the campaign has no run")
    return CampaignPlan(campaign, recordings, count)


def _once(campaign: Campaign, recordings: RecordingSet) -> Iterator[Case]:
    return (case for source in campaign.sources for case in _of(source, campaign, recordings))


def _fingerprint(case: Case) -> int:
    """Eight bytes for a name: a million of them fit into memory, and none meets another."""
    text = "\0".join(case.key)
    return int.from_bytes(hashlib.blake2b(text.encode(), digest_size=8).digest(), "big")


def _taught(campaign: Campaign, recordings: RecordingSet) -> tuple[str, ...]:
    """Nominal bags for baselines that learn, unless the campaign cross-calibrates."""
    if campaign.calibration == HALVES:
        return ()
    runs = recordings.matching(campaign.learn_from, campaign.folder)
    return tuple(str(run.bag) for run in runs)


def plan_sha256(campaign: Campaign, cases: Iterable[Case], besides: str = "") -> str:
    """Digest of the runs and of what is right: guards against mixing results of two plans.

    That of the JSON list of both, taken piece by piece: as one text it would fill the memory.
    ``besides`` is what else the results depend on, such as the text of a diagnoser of others.
    """
    digest = hashlib.sha256(b"[[")
    for number, case in enumerate(cases):
        content = {**asdict(case), "calibration": ""}
        del content["classifier"]  # a path, like the calibration: not part of the plan
        if case.stand == DEFAULT_STAND:
            del content["stand"]  # plans from before there were others say the same
        text = json.dumps(content, sort_keys=True)
        digest.update((f", {text}" if number else text).encode())
    expected = json.dumps({k: list(v) for k, v in campaign.expect.items()}, sort_keys=True)
    digest.update(f"], {expected}]{besides}".encode())
    return digest.hexdigest()


def _of(source: Any, campaign: Campaign, recordings: RecordingSet) -> Iterator[Case]:
    if isinstance(source, Drawn):
        return _drawn(source, campaign)
    if isinstance(source, Scenarios):
        return _scenarios(source, campaign)
    if isinstance(source, Recordings):
        return _recorded(source, campaign, recordings)
    if isinstance(source, Injections):
        return _injected(source, campaign, recordings)
    return _spliced(source, campaign, recordings)


# --- simulated ----------------------------------------------------------------------------


def _drawn(source: Drawn, campaign: Campaign) -> Iterator[Case]:
    from flea_sim_driver.scenario import table4
    from flea_sim_driver.scenario.scenario_file import scenario_to_mapping

    shared = table4.Shared(
        source.duration_s,
        source.earliest_onset_s,
        source.latest_onset_s,
        {
            "unit_seed": source.unit_seed,
            "unit_spread": source.unit_spread,
            "spread": dict(source.spread),
            "sensors": {"vibration": source.vibration, "voltage": source.voltage},
        },
        _machine(source.machine, campaign),
    )
    rows = tuple(_table_row(row, source.times) for row in source.rows)
    for row, scenario in table4.draw(rows, source.seed, shared):
        name = f"{source.name}/{_slug(row.title)}/{scenario.run.name}"
        recipe = Recipe(scenario=scenario_to_mapping(scenario))
        yield Case(name, "simulated", row.title, recipe, calibration=campaign.calibration_path())


def _machine(name: str, campaign: Campaign) -> str:
    """A machine by its name, or a file in the campaign's folder."""
    local = campaign.folder / name
    return str(local.resolve()) if name and local.is_file() else name


def _table_row(row: FaultCases, times: int) -> Any:
    from flea_sim_driver.scenario import table4

    return table4.CampaignRow(
        row.title,
        row.fault,
        row.cases * times,
        row.low,
        row.high,
        row.either_sign,
        row.switched,
        row.sizes,
        row.warmer_k,
    )


def _scenarios(source: Scenarios, campaign: Campaign) -> Iterator[Case]:
    from flea_sim_driver.scenario.library import find_scenario
    from flea_sim_driver.scenario.scenario_file import scenario_to_mapping

    for name in source.files:
        local = campaign.folder / name
        machine = _machine(source.machine, campaign)
        found = find_scenario(str(local) if local.is_file() else name, machine)
        vibration = found.sensors.vibration and source.vibration
        for seed in range(source.seed, source.seed + source.times):
            scenario = replace(
                found,
                run=replace(found.run, seed=seed),
                sensors=replace(found.sensors, vibration=vibration),
            )
            yield Case(
                f"{source.name}/{found.run.name}/{seed}",
                "simulated",
                found.run.name,
                Recipe(scenario=scenario_to_mapping(scenario)),
                calibration=campaign.calibration_path(),
            )


# --- recorded -----------------------------------------------------------------------------


def _recorded(source: Recordings, campaign: Campaign, recordings: RecordingSet) -> Iterator[Case]:
    for run in recordings.matching(source.files, campaign.folder):
        kind = "simulated" if run.simulated else "real"
        recipe = Recipe(recording=str(run.bag))
        case = Case(f"{source.name}/{run.name}", kind, run.truth or "unknown", recipe)
        yield from _folded(case, run, recordings)


def _injected(source: Injections, campaign: Campaign, recordings: RecordingSet) -> Iterator[Case]:
    """The cases of each row, or of each size of its ladder; recordings by turns."""
    from flea_diag.tools.recordings import injection

    runs = [r for r in recordings.matching(source.files, campaign.folder) if r.truth == NOMINAL]
    if not runs:
        raise ConfigurationError(f"{source.name}: no nominal recording to inject faults into")
    known = {f"{row.channel} {row.mode}": row for row in injection.ROWS}
    for title in source.rows or known:
        if title not in known:
            raise ConfigurationError(
                f"{source.name}: rows: {shown(title)} is unknown, choose among {', '.join(known)}"
            )
        rungs = known[title].ladder if source.ladder else (None,)
        cases = [rung for rung in rungs for _ in range(source.cases)]
        for number, rung in enumerate(cases):
            run = runs[number % len(runs)]
            recipe = Recipe(
                recording=str(run.bag), fault=title, size=rung, seed=source.seed, number=number
            )
            name = f"{source.name}/{_slug(title)}/{number + 1:03d}"
            yield from _folded(Case(name, "injected", title, recipe), run, recordings)


def _folded(case: Case, run: RecordedRun, recordings: RecordingSet) -> Iterator[Case]:
    """The case with each calibration that may score the run."""
    for fold, calibration in recordings.calibrations(run):
        yield replace(
            case,
            fold=fold,
            calibration=calibration,
            learned_from=recordings.learned_from(fold),
        )


def _spliced(source: Switches, campaign: Campaign, recordings: RecordingSet) -> Iterator[Case]:
    """Every faulty run with a nominal run of the same motion and load."""
    nominal: dict[str, RecordedRun] = {}
    for run in recordings.matching(source.nominal, campaign.folder):
        if run.truth == NOMINAL:
            nominal[_profile(run.name)] = run
    for run in recordings.matching(source.faulty, campaign.folder):
        before = nominal.get(_profile(run.name))
        if before is None or not run.truth or run.truth == NOMINAL:
            continue
        recipe = Recipe(recording=str(before.bag), faulty=str(run.bag), margin_s=source.margin_s)
        case = Case(f"{source.name}/{run.name}", "spliced", run.truth, recipe)
        yield from _folded(case, before, recordings)


def _profile(name: str) -> str:
    match = PROFILE.match(name)
    return match[1] if match else name


def _slug(title: str) -> str:
    return re.sub(r"[^a-z0-9]+", "_", title.lower()).strip("_")
