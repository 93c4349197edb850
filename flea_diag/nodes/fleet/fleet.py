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

"""``ros2 run flea_diag fleet``: the diagnosis of many stands in one process."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from flea_diag import __version__
from flea_diag.configuration.component import DIAGNOSER
from flea_diag.errors import ConfigurationError
from flea_diag.nodes.fleet.fleet_parameters import FleetParameters, values_of
from flea_diag.nodes.fleet.fleet_stand import FleetStand
from flea_diag.nodes.fleet.stand_list import stand_entries
from flea_diag.nodes.stage.compile_progress import CompileProgress
from flea_diag.nodes.stage.inbox import Turns
from flea_diag.nodes.stage.ports import JUDGEMENTS, SOURCES
from flea_diag.wire.bus import Bus, Program
from flea_diag.wire.records import Health, Level, VibrationLevel

REPORT_S = 1.0


class Fleet:
    """Builds the diagnosers, starts them together, and says how they are.

    What is known of a stand is built once for all that have the same files.
    """

    def __init__(self) -> None:
        self._refused: dict[tuple[str, str], Exception] = {}
        """Files of a stand -> why it cannot be built."""

    @staticmethod
    def check(parameters: Any) -> None:
        """Refuse a list of stands that cannot be read; a stand that cannot be built is left out."""
        stand_entries(parameters.stands)

    def prepare(self, bus: Bus[Any], parameters: Any) -> None:
        """Compile and load what the stands share."""
        entries = stand_entries(parameters.stands)
        bus.info(f"flea_diag {__version__}, {len(entries)} stands; warming up")
        self._refused.clear()
        for entry in {entry.files: entry for entry in entries}.values():
            values = DIAGNOSER.parameters(**values_of(entry, parameters))
            try:
                bus.info(DIAGNOSER.described(values))
                DIAGNOSER.warm_up(values, CompileProgress(bus))
            except Exception as error:  # whatever is wrong with one stand, the others start
                self._refused[entry.files] = error

    def start(self, bus: Bus[Any], parameters: Any) -> Callable[[], None]:
        """Build every stand that can be built."""
        turns = Turns(bus, parameters.batch_ms)
        stands: list[FleetStand] = []

        def close() -> None:
            for stand in stands:
                stand.close()

        for entry in stand_entries(parameters.stands):
            stands.append(FleetStand(bus, entry, parameters, turns))
            stands[-1].build(self._refused.get(entry.files))
        if not any(stand.built for stand in stands):
            close()
            raise ConfigurationError(f"no stand can be built; the first: {stands[0].trouble}")
        bus.on("activate", lambda: _each(stands, FleetStand.activate))
        bus.on("deactivate", lambda: _each(stands, FleetStand.deactivate))
        bus.every(REPORT_S, lambda: bus.publish(report(bus, stands)))
        return close


def _each(stands: Sequence[FleetStand], do: Callable[[FleetStand], None]) -> None:
    for stand in stands:
        do(stand)


def report(bus: Bus[Any], stands: Sequence[FleetStand]) -> Health:
    """Health of the fleet: how many stands run, and why the others do not."""
    missing = [stand for stand in stands if not stand.running]
    words = f"{len(stands) - len(missing)} of {len(stands)} stands running"
    if missing:
        words += "; not: " + "; ".join(f"{each.namespace} ({each.words})" for each in missing[:3])
    if len(missing) > 3:
        words += f" and {len(missing) - 3} more"
    level = Level.ERROR if missing else Level.OK
    values = tuple((each.namespace, each.words) for each in stands)
    return Health(bus.now_ns(), bus.name, level, words, (("state", bus.state), *values))


def program() -> Program:
    """Description of this node."""
    fleet = Fleet()
    return Program(
        "fleet",
        "Runs the diagnoser of many stands in one process, each in its namespace. A stand that "
        "cannot be built is left out, one that fails is set aside; the others go on.",
        FleetParameters,
        fleet.start,
        SOURCES,
        (VibrationLevel, *JUDGEMENTS, Health),
        (
            "ros2 run flea_diag fleet --ros-args -p stands:=\"['bay_1', 'bay_2=./mine']\"",
            "ros2 run flea_diag fleet --ros-args --params-file fleet.yaml -p batch_ms:=20",
            "ros2 lifecycle set /bay_2/diagnoser configure     # a stand set aside, once mended",
        ),
        fleet.prepare,
        fleet.check,
    )
