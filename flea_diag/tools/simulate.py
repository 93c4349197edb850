"""``flea simulate``: the simulated stand straight into a bag, without ROS."""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from flea_diag.errors import ConfigurationError

if TYPE_CHECKING:
    from flea_diag.wire.records import Truth
    from flea_sim_driver.scenario import Scenario

NAME = "simulate"
SUMMARY = "run a scenario of the simulated stand into a bag, faster than real time"
EXAMPLES = """\
examples:
  flea simulate --list                                 scenarios and faults there are
  flea simulate jam -o bags/jam --seed 3
  flea simulate nominal -o bags/short --fault winding_short --at 12 --size 0.3
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``flea simulate``."""
    parser.add_argument("scenario", nargs="?", help="YAML file, or name: see --list")
    parser.add_argument("-o", "--output", metavar="BAGDIR", type=Path, help="bag to write")
    parser.add_argument("--seed", type=int, help="seed of units and noise")
    parser.add_argument("--duration", type=float, metavar="S", help="length in s")
    parser.add_argument("--fault", help="fault to add, for example jam")
    parser.add_argument("--at", type=float, default=10.0, metavar="S", help="its onset (10 s)")
    parser.add_argument("--size", type=float, help="its size, default: the catalogue's")
    parser.add_argument("--no-vibration", action="store_true", help="slow channels alone")
    parser.add_argument(
        "--list", action="store_true", help="list the scenarios that come with flea and the faults"
    )


def run(arguments: argparse.Namespace) -> int:
    """Simulate; 0 when the bag is written."""
    if arguments.list:
        _print_catalogue()
        return 0
    if arguments.scenario is None or arguments.output is None:
        raise ConfigurationError("simulate: give a scenario and -o BAGDIR, or --list")
    from flea_sim_driver.stand import NOMINAL

    scenario = configured(arguments)
    begin = time.perf_counter()
    truths = write_bag(scenario, arguments.output)
    took = time.perf_counter() - begin
    faults = ", ".join(t.fault for t in truths if t.fault != NOMINAL) or NOMINAL
    print(
        f"{arguments.output}: {scenario.run.name}, {scenario.run.duration_s:g} s, seed "
        f"{scenario.run.seed}, {faults}; {scenario.run.duration_s / took:.0f} times real time",
        file=sys.stderr,
    )
    return 0


def configured(arguments: argparse.Namespace) -> Scenario:
    """The scenario with what the command line says instead.

    Raises
    ------
    ConfigurationError
        Unknown scenario or fault, or a value out of its limits.
    """
    from flea_sim_driver.feasibility import checked_scenario
    from flea_sim_driver.library import find_scenario
    from flea_sim_driver.settings import FaultSetting

    scenario = find_scenario(arguments.scenario)
    changes = {
        key: value
        for key, value in (("seed", arguments.seed), ("duration_s", arguments.duration))
        if value is not None
    }
    if arguments.seed is not None and arguments.seed < 0:
        raise ConfigurationError(f"simulate: --seed = {arguments.seed} is below its limit 0")
    if arguments.duration is not None and not arguments.duration >= 0.1:
        raise ConfigurationError(
            f"simulate: --duration = {arguments.duration} s is below its limit 0.1 s"
        )
    scenario = replace(scenario, run=replace(scenario.run, **changes))
    if arguments.no_vibration:
        scenario = replace(scenario, sensors=replace(scenario.sensors, vibration=False))
    if arguments.fault:
        size = float("nan") if arguments.size is None else arguments.size
        extra = FaultSetting(arguments.fault, arguments.at, size)
        scenario = replace(scenario, faults=(*scenario.faults, extra))
    return checked_scenario(scenario, "simulate")


def write_bag(scenario: Scenario, directory: Path) -> tuple[Truth, ...]:
    """Run a scenario into a bag; the truths that went with it."""
    from flea_diag.wire.bag import BagWriter
    from flea_diag.wire.records import Truth
    from flea_sim_driver.stand import Stand

    truths = []
    with BagWriter(directory, whole_every_s=None) as bag:
        for record in Stand(scenario):
            bag.write(record)
            if isinstance(record, Truth):
                truths.append(record)
    return tuple(truths)


def _print_catalogue() -> None:
    from flea_sim_driver.failure_modes import FAILURE_MODES
    from flea_sim_driver.faults import CATALOGUE
    from flea_sim_driver.library import scenario_names

    print("scenarios:")
    for name in scenario_names():
        print(f"  {name}")
    print("faults (default size, limits, where they act; onset_s, growth_s, on_s, off_s of each):")
    for row in CATALOGUE.values():
        print(
            f"  {row.id:28} {row.default_size:g} ({row.minimum:g} to {row.maximum:g}) "
            f"{row.size_unit}; {' or '.join(row.places)}; {row.approach}"
        )
    print("failure modes of the paper's Table 1, and how this stand shows them:")
    for mode in FAILURE_MODES:
        shown = f"{' or '.join(mode.faults)}: {mode.how}" if mode.faults else f"not: {mode.reason}"
        print(f"  {mode.component}, {mode.mode} ({mode.approach}): {shown}")
