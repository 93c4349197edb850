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

"""``flea simulate``: a run of the simulated stand into a bag, without ROS."""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flea_diag.errors import ConfigurationError
from flea_diag.tools.argument import add_json
from flea_diag.tools.terminal import say, write_json

if TYPE_CHECKING:
    from flea_diag.wire.records import Truth
    from flea_sim_driver.scenario.scenario import Scenario

CLOCK_S = 1e-6
"""Least time that a clock tells, also one that somebody has stopped."""
NAME = "simulate"
SUMMARY = "simulate a scenario of the stand into a bag, faster than real time"
EXAMPLES = """\
examples:
  flea simulate --list                                 list scenarios and faults
  flea simulate jam -o bags/jam --seed 3
  flea simulate nominal -o bags/short --fault winding_short --at 12 --size 0.3
  flea simulate nominal --machine ema -o bags/ema      another machine's scenario of that name
  flea simulate --list --machine ema                   and its scenarios and faults
"""

ONSET_S = 10.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``flea simulate``."""
    parser.add_argument("scenario", nargs="?", help="YAML file, or name from --list")
    parser.add_argument("-o", "--output", metavar="BAGDIR", type=Path, help="bag to write")
    parser.add_argument(
        "--machine",
        default="",
        metavar="NAME|YAML",
        help="simulated machine: name of a shipped one, or a file (default: the scenario's)",
    )
    parser.add_argument("--seed", type=int, help="seed of the units and of all noise")
    parser.add_argument(
        "--unit-seed", type=int, help="seed of the units and their sensors alone (default: --seed)"
    )
    parser.add_argument("--duration", type=float, metavar="S", help="duration of the run, s")
    parser.add_argument("--fault", help="fault to add, for example jam")
    parser.add_argument("--at", type=float, metavar="S", help=f"onset of --fault ({ONSET_S:g} s)")
    parser.add_argument(
        "--size", type=float, help="size of --fault (default: that of the catalogue)"
    )
    parser.add_argument("--no-vibration", action="store_true", help="without accelerometers")
    parser.add_argument(
        "--list", action="store_true", help="list the installed scenarios and all faults"
    )
    add_json(parser, "the run and its truth")


def run(arguments: argparse.Namespace) -> int:
    """Simulate; return 0 when the bag is written."""
    if arguments.list:
        _print_catalogue(arguments.machine)
        return 0
    if arguments.scenario is None or arguments.output is None:
        raise ConfigurationError("simulate: a scenario and -o BAGDIR, or --list, are required")
    from flea_sim_driver.stand import NOMINAL

    scenario = configured(arguments)
    begin = time.perf_counter()
    truths = write_bag(scenario, arguments.output)
    took = max(time.perf_counter() - begin, CLOCK_S)
    faults = ", ".join(t.fault for t in truths if t.fault != NOMINAL) or NOMINAL
    say(
        f"{arguments.output}: {scenario.run.name}, {scenario.run.duration_s:g} s, seed "
        f"{scenario.run.seed}, {faults}; {scenario.run.duration_s / took:.0f} times real time",
        file=sys.stderr,
    )
    if arguments.json:
        write_json(arguments.json, _told(scenario, arguments.output, truths))
    return 0


def _told(scenario: Scenario, bag: Path, truths: tuple[Truth, ...]) -> dict[str, Any]:
    """The run as plain values."""
    return {
        "bag": str(bag),
        "scenario": scenario.run.name,
        "seed": scenario.run.seed,
        "duration_s": scenario.run.duration_s,
        "truth": [{"fault": t.fault, "onset_ns": t.onset_ns, **dict(t.details)} for t in truths],
    }


def configured(arguments: argparse.Namespace) -> Scenario:
    """The scenario with the values given on the command line.

    Raises
    ------
    ConfigurationError
        Unknown scenario or fault, or a value outside its limits.
    """
    from flea_sim_driver.scenario.library import find_scenario
    from flea_sim_driver.scenario.scenario_file import overridden

    scenario = find_scenario(arguments.scenario, arguments.machine)
    if arguments.no_vibration:
        scenario = replace(scenario, sensors=replace(scenario.sensors, vibration=False))
    run = given(seed=arguments.seed, unit_seed=arguments.unit_seed, duration_s=arguments.duration)
    return overridden(scenario, "simulate", run, _fault(arguments))


def _fault(arguments: argparse.Namespace) -> dict[str, Any] | None:
    """The fault to add, with onset and size; None without --fault."""
    told = given(onset_s=arguments.at, size=arguments.size)
    if arguments.fault:
        return {"fault": arguments.fault, "onset_s": ONSET_S, **told}
    if told:
        raise ConfigurationError("simulate: --at and --size require --fault")
    return None


def given(**options: Any) -> dict[str, Any]:
    """The options that are not None."""
    return {name: value for name, value in options.items() if value is not None}


def write_bag(scenario: Scenario, directory: Path) -> tuple[Truth, ...]:
    """Simulate a scenario into a bag; return its truths. Of a failure no part of a bag is left.

    Raises
    ------
    RecordingError
        The folder is in use, or the disk is full.
    """
    from flea_diag.wire.bags.bag_writer import new_bag
    from flea_diag.wire.records import Truth
    from flea_sim_driver.stand import SimulatedStand

    truths = []
    with new_bag(directory) as bag:
        for record in SimulatedStand(scenario):
            bag.write(record)
            if isinstance(record, Truth):
                truths.append(record)
    return tuple(truths)


def _print_catalogue(named: str) -> None:
    from flea_sim_driver.failure_modes import FAILURE_MODES
    from flea_sim_driver.faults import catalogue
    from flea_sim_driver.machine.library import DEFAULT_MACHINE, find_machine, machine_names
    from flea_sim_driver.scenario.flight_profiles import FLIGHT_PROFILES
    from flea_sim_driver.scenario.library import scenario_names

    machine = find_machine(named or DEFAULT_MACHINE)
    say("machines:")
    for name in machine_names():
        say(f"  {name:8} {find_machine(name).description}")
    say(f"scenarios of {machine.name}:")
    for name in scenario_names(named):
        say(f"  {name}")
    say("faults (default size, limits, place, approach; each with onset_s, growth_s, on_s, off_s):")
    for row in catalogue(machine).values():
        say(
            f"  {row.id:28} {row.default_size:g} ({row.minimum:g} to {row.maximum:g}) "
            f"{row.size_unit}; {' or '.join(row.places)}; {row.approach}"
        )
    if machine.name != DEFAULT_MACHINE:
        return
    say("control surfaces in flight (flea scenarios flight writes them; motion.profile):")
    for row in FLIGHT_PROFILES:
        say(f"  {row.name:24} {row.shape}; {row.source}")
    say("failure modes of the paper's Table 1 (flea scenarios table1 writes them):")
    for mode in FAILURE_MODES:
        say(f"  {mode.component}, {mode.mode} ({mode.approach}): {mode.shown}")
        say(f"      {mode.effect}; found by: {mode.found}; {' or '.join(mode.group) or 'no alarm'}")
