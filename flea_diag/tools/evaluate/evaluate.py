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

"""``flea evaluate``: replays the runs of a campaign, scores them and writes a report."""

from __future__ import annotations

import argparse
import hashlib
import shutil
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flea_diag.errors import ConfigurationError
from flea_diag.tools.argument import add_cluster, add_json, count, positive
from flea_diag.tools.extra import require
from flea_diag.tools.planned_runs import add_option, check_planned
from flea_diag.tools.stand_option import add_stand
from flea_diag.tools.terminal import IN_PART, say, warn, write_json, write_text

if TYPE_CHECKING:
    from flea_diag.tools.arena.entrant import Arena
    from flea_diag.tools.campaign.campaign import Campaign
    from flea_diag.tools.campaign.case import Case
    from flea_diag.tools.campaign.result_log import ResultLog
    from flea_diag.tools.campaign.run_result import RunResult
    from flea_diag.tools.evaluate.case_pool import Work

NAME = "evaluate"
SUMMARY = "diagnose the recordings and scenarios of a campaign, and score the results"
EXAMPLES = """\
examples:
  flea evaluate small.yaml -o results/small          a campaign that is installed with flea
  flea evaluate table4.yaml -o results/table4 -j 4   four processes; Ctrl-C stops, it can resume
  flea evaluate bags/ -o results/bags                every bag of a folder
  flea evaluate bags/ --stand ./mine                 bags of a stand of your own
  flea evaluate small.yaml --diagnoser examples/limits.py:Limits     your own beside ours
  flea evaluate real.yaml -o results/real --dask tcp://10.0.0.5:8786

The same command resumes a campaign that was interrupted, and repeats runs that failed.
Recordings are looked for in the campaign's folder, then in the folder that FLEA_DATA_DIR names.
FOLDER holds report.html, summary.json, results.jsonl, and the details of each run below runs.
Exit status: 0 all rows meet the campaign's limit, 1 a row is below it or a run failed,
2 refused, 130 interrupted.
"""
SUMMARY_FILE = "summary.json"
REPORT_FILE = "report.html"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument(
        "campaign", type=Path, metavar="CAMPAIGN", help="YAML file, or a folder of bags"
    )
    parser.add_argument(
        "-o", "--output", type=Path, metavar="FOLDER", help="results (default: evaluations/NAME)"
    )
    parser.add_argument("-j", "--jobs", type=int, help="processes (default: one per core)")
    add_cluster(parser)
    parser.add_argument(
        "--drawn",
        type=int,
        default=400,
        metavar="N",
        help="runs to draw, wrong ones first (default: 400, about 70 kB each)",
    )
    add_stand(parser)
    parser.add_argument(
        "--calibration", metavar="FILE", help="calibration instead of the campaign's own"
    )
    parser.add_argument(
        "--diagnoser",
        action="append",
        default=[],
        metavar="[LABEL=]WHO",
        help="diagnoser of your own beside those of the campaign, repeatable: FILE.py:CLASS, "
        "MODULE:CLASS, an entry point of flea_diag.diagnosers, process:COMMAND or node:COMMAND",
    )
    parser.add_argument(
        "--limit-s",
        type=positive,
        default=120.0,
        metavar="S",
        help="time that one may take for a run (default %(default)s s)",
    )
    parser.add_argument(
        "--memory-mb",
        type=count,
        default=1024,
        metavar="MB",
        help="memory that one may take (default %(default)s MB)",
    )
    add_option(parser)
    parser.add_argument("--force", action="store_true", help="delete earlier results, start again")
    add_json(parser, "summary.json")
    parser.add_argument("-q", "--quiet", action="store_true", help="no progress, no tables")


def run(arguments: argparse.Namespace) -> int:
    """Run what is not done yet and score all results; 0 if every row meets its limit."""
    from flea_diag.tools.campaign.campaign import load_campaign
    from flea_diag.tools.campaign.case import plan, plan_sha256
    from flea_diag.tools.campaign.recording_set import RecordingSet
    from flea_diag.tools.campaign.result_log import ResultLog, held
    from flea_diag.tools.campaign.run_count import run_count
    from flea_diag.tools.evaluate.case_run import run_case
    from flea_diag.tools.workers import jobs_of

    # Checked now, not when the report is written after hours.
    require("evaluate", "evaluate")
    jobs = jobs_of(arguments.jobs)
    campaign = _on_stand(load_campaign(arguments.campaign), arguments)
    arena = _arena(campaign, arguments)
    labels = tuple(each.label for each in arena.entrants)
    campaign = replace(campaign, configurations=(*campaign.configurations, *labels))
    folder: Path = (arguments.output or Path("evaluations") / campaign.name).resolve()
    recordings = RecordingSet(campaign, folder)
    planned = run_count(campaign, recordings)
    check_planned(planned, campaign.name, allow_large=arguments.allow_large)
    cases = plan(campaign, recordings)
    work = partial(run_case, expect=dict(campaign.expect), folder=folder, arena=arena)
    with held(folder):
        if arguments.force:
            _begin_anew(folder)
        besides = arena.plan() + _given_calibration(campaign, arguments)
        with ResultLog(folder, plan_sha256(campaign, cases, besides)) as log:
            done = log.done.values()
            finished = {key for key, result in log.done.items() if not result.failure}
            left = len(cases) - len(finished)
            try:
                if left:
                    recordings.prepare()
                    rest = (case for case in cases if case.key not in finished)
                    results = _results(rest, work, jobs, arguments.dask)
                    _keep(results, log, _bar(len(cases), left, arguments.quiet))
            except KeyboardInterrupt:
                _score(campaign, done, folder, arguments.drawn, True)
                warn(f"{len(done)} of {len(cases)} runs are done; the same command resumes")
                raise
            quiet = arguments.quiet or arguments.json == "-"
            return _score(campaign, done, folder, arguments.drawn, quiet, arguments.json)


def _arena(campaign: Campaign, arguments: argparse.Namespace) -> Arena:
    """The diagnosers of others that are named, and what their runs may take."""
    from flea_diag.tools.arena.entrant import Arena, entrants
    from flea_diag.tools.evaluate.baselines import BASELINES

    found = entrants(arguments.diagnoser, (*BASELINES, *campaign.configurations))
    return Arena(found, arguments.limit_s, arguments.memory_mb)


def _given_calibration(campaign: Campaign, arguments: argparse.Namespace) -> str:
    """Digest of a calibration given beside the plan: results of two are not mixed."""
    if not arguments.calibration:
        return ""
    content = Path(campaign.calibration).read_bytes()
    return f" calibration {hashlib.sha256(content).hexdigest()}"


def _on_stand(campaign: Campaign, arguments: argparse.Namespace) -> Campaign:
    """The campaign with the stand and the calibration that the arguments name."""
    from flea_diag.configuration.calibrations import learned
    from flea_diag.configuration.files import given_file, is_bare
    from flea_diag.configuration.stand import load_stand
    from flea_diag.tools.campaign.campaign import HALVES

    if arguments.stand:
        bare = is_bare(arguments.stand)
        stand = arguments.stand if bare else str(Path(arguments.stand).absolute())
        campaign = replace(campaign, stand=stand)
    if arguments.calibration:
        found = given_file(arguments.calibration).absolute()
        campaign = replace(campaign, calibration=str(found))
    stand = load_stand(campaign.stand_path(), calibration=campaign.calibration_path())
    if campaign.calibration != HALVES:
        learned(stand)  # refused now, not in every run
    return campaign


def _begin_anew(folder: Path) -> None:
    """Delete results and calibrations, keep imported bags; refuse any other folder."""
    from flea_diag.tools.campaign.result_log import PLAN, RESULTS
    from flea_diag.tools.evaluate.case_run import DETAILS

    if folder.exists() and not (folder / PLAN).exists() and any(folder.iterdir()):
        raise ConfigurationError(f"{folder} holds no evaluation: --force does not delete it")
    for name in (DETAILS, "calibrations"):
        shutil.rmtree(folder / name, ignore_errors=True)
    for name in (RESULTS, PLAN, SUMMARY_FILE, REPORT_FILE):
        (folder / name).unlink(missing_ok=True)


def _results(left: Iterable[Case], work: Work, jobs: int, dask: str) -> Iterator[RunResult]:
    from flea_diag.tools.evaluate.case_pool import run_all, run_on_dask

    return run_on_dask(left, work, dask) if dask else run_all(left, work, jobs)


def _bar(count: int, left: int, quiet: bool) -> Any:
    """Progress bar with rate and time left, on a terminal only."""
    from tqdm import tqdm

    shown = None if not quiet else True
    return tqdm(total=count, initial=count - left, unit="run", smoothing=0.05, disable=shown)


def _keep(results: Iterator[RunResult], log: ResultLog, bar: Any) -> None:
    wrong = 0
    with bar:
        for result in results:
            log.add(result)
            wrong += not result.right
            bar.set_postfix_str(f"{wrong} wrong", refresh=False)
            bar.update()
            if result.failure:
                bar.write(f"flea: {result.id}: {result.failure}", file=sys.stderr)


def _score(
    campaign: Campaign,
    results: Iterable[RunResult],
    folder: Path,
    drawn: int,
    quiet: bool,
    told: str | None = None,
) -> int:
    from flea_diag.tools.score.summary import summarise, tables

    known = tuple(results)
    summary = summarise(campaign, known)
    write_json(str(folder / SUMMARY_FILE), summary)
    _report(campaign, known, summary, folder, drawn)
    if told:
        write_json(told, summary)
    if not quiet:
        say(tables(summary))
        say(f"results in {folder}, report in {folder / REPORT_FILE}")
    return IN_PART if summary["lost_rows"] or summary["failed"] else 0


def _report(
    campaign: Campaign,
    results: Sequence[RunResult],
    summary: dict[str, Any],
    folder: Path,
    most: int,
) -> None:
    """Write the report, and each drawing beside the details of its run."""
    from datetime import datetime, timezone

    from flea_diag.tools.campaign.run_trace import read_trace
    from flea_diag.tools.score.report import drawing, drawing_of, neighbours, page, to_draw

    kept = [r for r in results if r.failure or (r.detail and read_trace(folder / r.detail))]
    chosen = to_draw(kept, most)
    for result, before, after in neighbours(chosen):
        if trace := read_trace(folder / result.detail):
            write_text(folder / drawing_of(result), drawing(result, trace, before, after))
    made = datetime.now(timezone.utc).strftime("%Y-%m-%d %H:%M UTC")
    drawn = {result.key for result in chosen}
    text = page(f"Evaluation: {campaign.name}", made, results, summary, drawn)
    write_text(folder / REPORT_FILE, text)
