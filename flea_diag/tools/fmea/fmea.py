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

"""``flea fmea``: every failure of the catalogue run, what it does, and whether it is found."""

from __future__ import annotations

import argparse
import shutil
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flea_diag.errors import ConfigurationError
from flea_diag.tools.argument import add_json, positive
from flea_diag.tools.extra import require
from flea_diag.tools.stand_option import absolute, accepted_stand, add_calibration
from flea_diag.tools.terminal import (
    IN_PART,
    make_folder,
    progress,
    tell,
    warn,
    write_text,
)

if TYPE_CHECKING:
    from flea_diag.configuration.stand import Stand
    from flea_diag.tools.fmea.failure import AnalysedFailure, Failure
    from flea_diag.tools.fmea.motion_effect import MotionEffect
    from flea_sim_driver.machine.machine import Machine
    from flea_sim_driver.scenario.scenario import Scenario

NAME = "fmea"
SUMMARY = "analyse failure modes: what each does, whether it is found, how soon, what to do"
EXAMPLES = """\
examples:
  flea fmea -o fmea                                each fault of the shipped stand, three sizes
  flea fmea ema -o fmea --sizes 1                  of another stand, at the sizes of its catalogue
  flea fmea --table1 -o table1                     the 25 failure modes of the paper's Table 1
  flea fmea -o fmea --ratings ratings.yaml         with severity, occurrence and risk priority
  flea fmea ./mine -o fmea --bags bags/*Nominal* --calibration cal.yaml
                                                   of a real stand: faults injected into recordings

OUT holds fmea.html, fmea.csv and a bag of each line, for flea replay. Ratings from 1 to 10 stand in
YAML (jam: {severity: 8, occurrence: 3}) or in a CSV with fault, severity, occurrence; the rating of
the detection follows from what became of the run.
Exit status: 0 done, 1 a line could not be run, 2 refused, 130 interrupted.
"""
PAGE, TABLE = "fmea.html", "fmea.csv"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument(
        "stand", nargs="?", default="", metavar="STAND",
        help="folder of the stand as a path, or name of a shipped one (default: flea)",
    )  # fmt: skip
    parser.add_argument(
        "-o", "--output", type=Path, default=Path("fmea"), metavar="OUT",
        help="folder of the tables and the bags (default: %(default)s)",
    )  # fmt: skip
    parser.add_argument(
        "--machine", default="", metavar="NAME|YAML",
        help="machine that simulates it (default: the one named as the stand)",
    )  # fmt: skip
    parser.add_argument(
        "--scenario", default="nominal", help="motion and load (default: %(default)s)"
    )
    parser.add_argument("--table1", action="store_true", help="the paper's Table 1 (flea alone)")
    parser.add_argument(
        "--bags", nargs="+", type=Path, default=[], metavar="BAGDIR",
        help="healthy recordings: faults of sensors are injected, nothing is simulated",
    )  # fmt: skip
    add_calibration(parser)
    parser.add_argument(
        "--fault", action="append", default=[], metavar="ID", help="this fault alone, repeatable"
    )
    parser.add_argument(
        "--sizes", nargs="+", type=positive, default=[0.5, 1.0, 2.0], metavar="X",
        help="multiples of the default size of each fault (default: 0.5 1 2)",
    )  # fmt: skip
    parser.add_argument("--ratings", type=Path, metavar="FILE", help="severity and occurrence")
    parser.add_argument("--seed", type=int, default=1, help="of units and noise (default: 1)")
    parser.add_argument("-j", "--jobs", type=int, help="processes (default: one per core)")
    parser.add_argument("--force", action="store_true", help="delete an earlier analysis in OUT")
    add_json(parser, "all lines")


def run(arguments: argparse.Namespace) -> int:
    """Run every failure and write the tables; 0 if all of them ran."""
    from flea_diag.tools.fmea.catalogue_rows import chosen, known_faults
    from flea_diag.tools.fmea.failure_run import BAGS, FailureRun
    from flea_diag.tools.fmea.ratings import load_ratings
    from flea_diag.tools.workers import jobs_of

    require("evaluate", "fmea")
    jobs = jobs_of(arguments.jobs)
    stand = absolute(accepted_stand(arguments, "calibration"))
    failures, nominal, unit = _planned(arguments, stand)
    known = {*known_faults(stand), *(each.fault for each in failures)}
    failures = chosen(failures, arguments.fault)
    ratings = load_ratings(arguments.ratings, known) if arguments.ratings else {}
    folder: Path = arguments.output.absolute()
    _begin(folder, arguments.force, (BAGS, PAGE, TABLE))
    lines = []
    for line in _lines(failures, FailureRun(stand, folder, nominal), jobs):
        if line.broken:
            warn(f"{line.failure.name}: {line.broken}")
        rating = ratings.get(line.failure.fault)
        lines.append(replace(line, **asdict(rating)) if rating else line)
    lines.sort(key=lambda line: line.rank)
    return _written(arguments, stand, folder, lines, nominal, unit)


def _planned(
    arguments: argparse.Namespace, stand: Stand
) -> tuple[Sequence[Failure], MotionEffect | None, str]:
    """Every failure, the motion without any, and the unit of positions."""
    from flea_diag.tools.fmea import catalogue_rows as rows
    from flea_diag.tools.fmea.failure_run import effect_of
    from flea_diag.tools.fmea.healthy_bag import HealthyBag, injected
    from flea_sim_driver.failure_modes import ONSET_S

    known = rows.known_faults(stand)
    machine = _machine(arguments, stand)
    if arguments.bags:
        healthy = [HealthyBag(bag.absolute()) for bag in arguments.bags]
        return tuple(injected(healthy, known, machine, arguments.sizes)), None, ""
    if machine is None:
        raise ConfigurationError(
            f"fmea: no machine is named {stand.name}: name one by --machine, or healthy --bags"
        )
    scenario = _scenario(arguments, machine)
    unit = {row.channel: row.unit for row in machine.instruments}.get("commanded_position", "m")
    nominal = effect_of(scenario, ONSET_S)
    if arguments.table1:
        if machine.name != "flea":
            raise ConfigurationError(f"fmea: Table 1 is that of flea, not of {machine.name}")
        return tuple(rows.of_table1(known, machine, arguments.seed)), nominal, unit
    return tuple(rows.simulated(scenario, known, ONSET_S, arguments.sizes)), nominal, unit


def _machine(arguments: argparse.Namespace, stand: Stand) -> Machine | None:
    """The machine that is named, or the shipped one with the name of the stand."""
    from flea_sim_driver.machine.library import find_machine, machine_names

    if arguments.machine:
        return find_machine(arguments.machine)
    return find_machine(stand.name) if stand.name in machine_names() else None


def _scenario(arguments: argparse.Namespace, machine: Machine) -> Scenario:
    from flea_sim_driver.scenario.library import find_scenario
    from flea_sim_driver.scenario.scenario_file import overridden

    named = arguments.machine or machine.name
    scenario = find_scenario(arguments.scenario, named)
    quiet = replace(scenario, sensors=replace(scenario.sensors, vibration=False), faults=())
    return overridden(quiet, "fmea", {"seed": arguments.seed})


def _begin(folder: Path, force: bool, own: Sequence[str]) -> None:
    """Make the folder; delete what an earlier analysis wrote, and nothing else.

    Raises
    ------
    ConfigurationError
        The folder holds something, and nobody has said that it may be deleted.
    """
    if folder.is_dir() and any(folder.iterdir()):
        if not force:
            raise ConfigurationError(f"{folder} is not empty: --force deletes an earlier analysis")
        if not (folder / TABLE).is_file():
            raise ConfigurationError(f"{folder} holds no analysis: --force does not delete it")
        for name in own:
            shutil.rmtree(folder / name, ignore_errors=True)
            if (folder / name).is_file():
                (folder / name).unlink()
    make_folder(folder)


def _lines(failures: Sequence[Failure], work: Any, jobs: int) -> Iterator[AnalysedFailure]:
    """The line of each failure in their order, from so many processes."""
    from flea_diag.tools.fmea.failure import NOT_RUN, AnalysedFailure
    from flea_diag.tools.refused import Refused
    from flea_diag.tools.workers import in_order

    began_s = time.monotonic()
    done = in_order(work, failures, jobs)
    for number, (failure, line) in enumerate(zip(failures, done, strict=True), 1):
        progress(number, len(failures), failure.name, began_s)
        if isinstance(line, Refused):
            line = AnalysedFailure(failure, NOT_RUN, broken=line.words)
        yield line


def _written(
    arguments: argparse.Namespace,
    stand: Stand,
    folder: Path,
    lines: Sequence[AnalysedFailure],
    nominal: MotionEffect | None,
    unit: str,
) -> int:
    """Write page, table and JSON; the exit status."""
    from flea_diag.tools.fmea.table import as_csv, as_html, cells, counts
    from flea_diag.tools.origin import today

    of = "injected into recordings" if arguments.bags else f"simulated, seed {arguments.seed}"
    made = f"{today()}, {of}"
    write_text(folder / TABLE, as_csv(lines))
    write_text(folder / PAGE, as_html(f"FMEA of {stand.name}", made, lines, nominal, unit))
    content = {
        "stand": stand.name,
        "nominal": nominal and asdict(nominal),
        "lines": [cells(line) for line in lines],
    }
    counted = ", ".join(f"{count} {what}" for what, count in counts(lines))
    tell(arguments.json, content, f"{counted}\n{len(lines)} lines in {folder / PAGE}")
    return IN_PART if any(line.broken for line in lines) else 0
