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

"""``flea coverage``: how far behind the best a true fault may lie, for a stated coverage."""

from __future__ import annotations

import argparse
import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from flea_diag.errors import ConfigurationError
from flea_diag.tools.argument import add_json
from flea_diag.tools.stand_option import add_calibration, add_stand
from flea_diag.tools.terminal import make_folder, progress, tell, write_text

if TYPE_CHECKING:
    from flea_diag.configuration.stand import Stand
    from flea_diag.core.calibration.out_of_sample import GroupCoverage
    from flea_diag.tools.campaign.case import Case
    from flea_diag.wire.records import Record, Truth

NAME = "coverage"
SUMMARY = "calibrate the coverage of ambiguity groups on faulty runs"
EXAMPLES = """\
examples:
  flea coverage coverage.yaml -o calibration.yaml --force
  flea coverage faulty.yaml --stand ./mine -o mine/calibration.yaml --force

Nothing may have been tuned on the runs of the campaign. Each is diagnosed several times, to find
the smallest limit of the gap of log-likelihood at which its fault stays in the group.
"""
LADDER = (0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 8.0, 10.0, 15.0, 25.0, 50.0)
"""Limits that are tried, nats; scores are rounded up to one of them."""
NEVER = 1e6
"""A gap that no fault reaches."""
STATED = (0.8, 0.9, 0.95, 0.98)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("campaign", type=Path, metavar="CAMPAIGN", help="YAML file of faulty runs")
    parser.add_argument(
        "-o", "--output", required=True, type=Path, metavar="FILE", help="calibration to write"
    )
    parser.add_argument("--force", action="store_true", help="overwrite an existing file")
    add_calibration(parser, "calibration that is completed")
    add_stand(parser)
    add_json(parser, "scores of the runs, and the limits that they give,")


def run(arguments: argparse.Namespace) -> int:
    """Score the runs, write the calibration with the scores, say what they give."""
    import yaml

    from flea_diag.configuration.calibrations import learned
    from flea_diag.configuration.stand import load_stand
    from flea_diag.tools.campaign.campaign import HALVES, load_campaign
    from flea_diag.tools.campaign.case import plan
    from flea_diag.tools.campaign.recording_set import RecordingSet

    if arguments.output.exists() and not arguments.force:
        raise ConfigurationError(f"{arguments.output} exists: use --force to overwrite it")
    campaign = load_campaign(arguments.campaign)
    if campaign.calibration == HALVES:
        raise ConfigurationError(f"{arguments.campaign}: one calibration is needed, not halves")
    stand = load_stand(
        arguments.stand or campaign.stand_path(),
        calibration=arguments.calibration or campaign.calibration_path(),
    )
    calibration = replace(learned(stand), coverage=None)
    with TemporaryDirectory() as folder:
        recordings = RecordingSet(campaign, Path(folder))
        cases = list(plan(campaign, recordings))
        recordings.prepare()
        found = list(_scores(cases, stand))
    coverage = covered(campaign.name, found)
    completed = replace(calibration, coverage=coverage).to_mapping()
    make_folder(arguments.output.parent)
    write_text(arguments.output, yaml.safe_dump(completed, sort_keys=False, width=100))
    tell(arguments.json, _told(coverage, found), "\n".join(words(coverage, found)))
    return 0


def _told(coverage: GroupCoverage, found: Sequence[CoverageScore]) -> dict[str, Any]:
    """Scores and limits in nats; None where no limit keeps the fault, or there was no alarm."""
    limits = {f"{asked:g}": coverage.limit_nats(asked) for asked in STATED}
    rows = [{"fault": each.fault, "nats": each.nats} for each in found]
    counts = {"runs": coverage.runs, "missed": coverage.missed}
    return {**counts, "limits_nats": limits, "scores": rows}


def _scores(cases: Sequence[Case], stand: Stand) -> Iterator[CoverageScore]:
    for number, case in enumerate(cases, 1):
        progress(number, len(cases), case.id)
        score = scored(case, stand)
        if score is not None:
            yield score


@dataclass(frozen=True)
class CoverageScore:
    """One faulty run: the least limit that keeps its fault, infinity for none, NaN for no alarm."""

    fault: str
    nats: float


def scored(case: Case, stand: Stand) -> CoverageScore | None:
    """Score of one run; None where it has no fault."""
    from flea_diag.tools.campaign.case_records import first_fault, records_of

    records = list(records_of(case.recipe))
    truth = first_fault(records)
    if truth is None:
        return None
    held = partial(_held, records, stand, truth)
    # Whether there is an alarm no limit changes, and most faults are held by the least of them.
    first = held(LADDER[0])
    if first is None:
        return CoverageScore(truth.fault, math.nan)
    if first:
        return CoverageScore(truth.fault, LADDER[0])
    if not held(NEVER):
        return CoverageScore(truth.fault, math.inf)
    return CoverageScore(truth.fault, next(filter(held, LADDER[1:]), NEVER))


def _held(records: list[Record], stand: Stand, truth: Truth, limit_nats: float) -> bool | None:
    """Whether the last group after the onset holds the fault; None where there is none."""
    from flea_diag.configuration.component import make_pipeline
    from flea_diag.tools.evaluate.case_run import diagnose
    from flea_diag.wire.records import AmbiguityGroup

    done = diagnose(records, make_pipeline(stand, coverage=0.0, drop_nats=limit_nats))
    groups = [r for r in done.kept if isinstance(r, AmbiguityGroup) and r.episode]
    late = [g for g in groups if g.detected_stamp_ns >= truth.onset_ns]
    return any(m.fault == truth.fault for m in late[-1].members) if late else None


def covered(campaign: str, found: Sequence[CoverageScore]) -> GroupCoverage:
    """What a calibration keeps of these scores."""
    from flea_diag.core.calibration.out_of_sample import GroupCoverage

    nats = [score.nats for score in found]
    kept = tuple(sorted(value for value in nats if math.isfinite(value)))
    return GroupCoverage(campaign, kept, nats.count(math.inf), sum(map(math.isnan, nats)))


def words(coverage: GroupCoverage, found: Sequence[CoverageScore]) -> Iterator[str]:
    """The limits that the scores give, and which faults no limit keeps."""
    yield f"{coverage.runs} runs with a group, {coverage.missed} without an alarm"
    for asked in STATED:
        limit = coverage.limit_nats(asked)
        said = "not reached by any limit" if math.isinf(limit) else f"{limit:g} nats"
        yield f"coverage {asked:.0%}: {said}"
    lost = Counter(score.fault for score in found if score.nats == math.inf)
    for fault, count in lost.most_common():
        yield f"lost at any limit: {fault}, {count} of {sum(s.fault == fault for s in found)} runs"
