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

"""One failure: its bag, the diagnosis of it, and the line that follows."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from flea_diag.configuration.component import make_pipeline
from flea_diag.configuration.stand import Stand
from flea_diag.tools.campaign.case import Case, Recipe
from flea_diag.tools.campaign.case_records import records_of
from flea_diag.tools.evaluate.case_run import CaseDiagnosis, closing, diagnose, scored
from flea_diag.tools.fmea.failure import (
    MISSED,
    NOT_RUN,
    AnalysedFailure,
    Failure,
    became,
)
from flea_diag.tools.fmea.healthy_bag import HealthyBag
from flea_diag.tools.fmea.motion_effect import MotionEffect, MotionRecord
from flea_diag.tools.refused import why_failed
from flea_diag.wire.bags.bag_writer import new_bag
from flea_diag.wire.records import AmbiguityGroup, Record
from flea_sim_driver.scenario.scenario import Scenario
from flea_sim_driver.scenario.scenario_file import scenario_from_mapping
from flea_sim_driver.stand import SimulatedStand

BAGS = "bags"
"""Folder of the bags, beside the tables."""


@dataclass(frozen=True)
class FailureRun:
    """Runs failures on a stand, each into a bag of its own below ``folder``; picklable."""

    stand: Stand
    folder: Path
    nominal: MotionEffect | None = None
    """The motion without a failure."""

    def __call__(self, failure: Failure) -> AnalysedFailure:
        """The line of a failure; an error becomes a line that says so."""
        if not failure.runs:
            return AnalysedFailure(failure, NOT_RUN, remark=failure.remark)
        try:
            return self._run(failure)
        except Exception as error:  # a defect: the others continue, the line names the place
            return AnalysedFailure(failure, NOT_RUN, broken=why_failed(error))

    def _run(self, failure: Failure) -> AnalysedFailure:
        bag, effect = self.folder / BAGS / failure.name, None
        with new_bag(bag) as written:
            if failure.scenario:
                scenario = scenario_from_mapping(dict(failure.scenario), failure.name)
                record = MotionRecord(scenario.faults[0].onset_s)
                for each in watched(scenario, record):
                    written.write(each)
                effect = record.effect
            elif failure.injection is not None:
                for each in _healthy(failure.recording).with_fault(failure.injection):
                    written.write(each)
        with closing(make_pipeline(self.stand)) as stage:
            done = diagnose(records_of(Recipe(recording=str(bag))), stage)
        idle = effect is not None and effect.like(self.nominal)
        return _analysed(failure, done, effect, f"{BAGS}/{failure.name}", idle)


@lru_cache(maxsize=4)
def _healthy(path: str) -> HealthyBag:
    return HealthyBag(Path(path))


def watched(scenario: Scenario, into: MotionRecord) -> Iterator[Record]:
    """Records of a simulation, whose true signals are collected on the way."""
    stand = SimulatedStand(scenario)
    while not stand.finished:
        yield from stand.advance()
        if stand.block is not None:
            into.add(stand.block, stand.winding_degc)


def effect_of(scenario: Scenario, from_s: float) -> MotionEffect:
    """The motion of a scenario as it is, from a time on."""
    record = MotionRecord(from_s)
    for _ in watched(scenario, record):
        pass
    return record.effect


def _analysed(
    failure: Failure, done: CaseDiagnosis, effect: MotionEffect | None, bag: str, idle: bool
) -> AnalysedFailure:
    result, summary = scored(Case(failure.name, "simulated", failure.fault, Recipe()), {}, done)
    detected, episodes = result.detection_time_s is not None, summary["episodes"]
    what = became(failure, detected, bool(episodes), result.outcome, result.group)
    last = _last(done.kept) if episodes else None
    stated = dict(last.to_do) if last else {}
    words = (stated.get("urgency", ""), stated.get("run", ""), stated.get("procedure", ""))
    return AnalysedFailure(
        failure,
        what,
        effect,
        result.outcome,
        result.group,
        episodes[-1]["detected_by"] if episodes else "",
        result.detection_time_s,
        "; ".join(filter(None, words)),
        _missed(failure, summary, idle) if what == MISSED else failure.remark,
        bag,
    )


def _last(records: Iterable[object]) -> AmbiguityGroup | None:
    """Latest verdict on an episode."""
    groups = (r for r in records if isinstance(r, AmbiguityGroup) and r.episode > 0)
    return max(groups, key=lambda group: group.stamp_ns, default=None)


def _missed(failure: Failure, summary: dict[str, object], idle: bool) -> str:
    """Why a failure was not detected: as far as the verdict, or the row itself, says."""
    if failure.remark:
        return failure.remark
    rows: object = summary["not_observable"]
    unseen = {row["fault"]: row["reason"] for row in rows} if isinstance(rows, list) else {}
    if failure.fault in unseen:
        return str(unseen[failure.fault])
    if idle and not failure.of_sensor:
        return "no effect in this motion: tracking error and current are as without it"
    sizes = summary["shows_from"]
    least = sizes.get(failure.fault) if isinstance(sizes, dict) else None
    if least:
        return f"half of the recordings of the calibration would show it from {least}"
    return "does not show in this motion"
