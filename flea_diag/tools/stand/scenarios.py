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

"""``flea scenarios``: the scenarios of the paper's tables as YAML files, optionally as bags."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flea_diag.errors import ConfigurationError
from flea_diag.formats import stamped
from flea_diag.tools.argument import add_json
from flea_diag.tools.terminal import make_folder, progress, say, write_json, write_text

if TYPE_CHECKING:
    from flea_sim_driver.scenario.scenario import Scenario

NAME = "scenarios"
SUMMARY = (
    "write scenarios of the paper's tables, or of surfaces in flight, as files, optionally as bags"
)
EXAMPLES = """\
examples:
  flea scenarios table4 --seed 7 -o scenarios         write 320 YAML files
  flea scenarios table4 --seed 7 -o runs --bags       and simulate each into a bag
  flea scenarios table1 -o modes --bags               each of the 25 failure modes
  flea scenarios flight -o flown --bags               20 control surfaces in flight
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``flea scenarios``."""
    parser.add_argument("set", choices=("table1", "table4", "flight"), help="set of scenarios")
    parser.add_argument("--seed", type=int, default=1, help="seed of all draws (1)")
    parser.add_argument(
        "-o", "--output", metavar="DIR", type=Path, required=True, help="folder to write to"
    )
    parser.add_argument("--bags", action="store_true", help="simulate each scenario into DIR/bags")
    parser.add_argument("--no-vibration", action="store_true", help="bags without vibration")
    add_json(parser, "the scenarios with their faults")


def run(arguments: argparse.Namespace) -> int:
    """Write the files; return 0 when all are written."""
    from flea_sim_driver.failure_modes import table1
    from flea_sim_driver.scenario.flights import flights
    from flea_sim_driver.scenario.table4 import table4

    if arguments.seed < 0:
        raise ConfigurationError(f"scenarios: --seed = {arguments.seed} is below its limit 0")
    sets = {"table1": table1, "table4": table4, "flight": flights}
    scenarios = sets[arguments.set](arguments.seed)
    write_files(scenarios, arguments.output)
    say(f"{arguments.output}: {len(scenarios)} scenarios", file=sys.stderr)
    if arguments.bags:
        _write_bags(scenarios, arguments.output / "bags", vibration=not arguments.no_vibration)
    if arguments.json:
        write_json(arguments.json, [_told(scenario) for scenario in scenarios])
    return 0


def _told(scenario: Scenario) -> dict[str, Any]:
    faults = [{"fault": each.fault, "onset_s": each.onset_s} for each in scenario.faults]
    return {"scenario": scenario.run.name, "seed": scenario.run.seed, "faults": faults}


def write_files(scenarios: tuple[Scenario, ...], folder: Path) -> None:
    """Write one YAML file per scenario.

    Raises
    ------
    ConfigurationError
        The folder cannot be written.
    """
    import yaml

    from flea_sim_driver.scenario.scenario_file import scenario_to_mapping

    make_folder(folder)
    for scenario in scenarios:
        content = stamped("scenario", scenario_to_mapping(scenario))
        text = yaml.safe_dump(content, sort_keys=False)
        write_text(folder / f"{scenario.run.name}.yaml", text)


def _write_bags(scenarios: tuple[Scenario, ...], folder: Path, *, vibration: bool) -> None:
    from dataclasses import replace

    from flea_diag.tools.stand.simulate import write_bag

    for number, scenario in enumerate(scenarios, start=1):
        sensors = replace(scenario.sensors, vibration=vibration)
        write_bag(replace(scenario, sensors=sensors), folder / scenario.run.name)
        progress(number, len(scenarios), scenario.run.name)
