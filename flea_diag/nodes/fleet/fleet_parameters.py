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

"""Parameters of a fleet: its stands, and those of the diagnoser that hold for all of them."""

from __future__ import annotations

from dataclasses import fields, make_dataclass
from typing import Any

from flea_diag.configuration.component import DIAGNOSER
from flea_diag.nodes.fleet.stand_list import StandEntry
from flea_diag.wire.parameters import parameter

OF_EACH = ("stand", "calibration")
"""Parameters of a diagnoser that the list of stands gives."""
MEMORY, EACH = "memory", "each"


def _of_all() -> list[tuple[str, Any, Any]]:
    return [
        (entry.name, entry.type, parameter(entry.default, **entry.metadata))
        for entry in fields(DIAGNOSER.parameters)
        if entry.name not in (*OF_EACH, MEMORY)
    ]


FleetParameters: type[Any] = make_dataclass(
    "FleetParameters",
    [
        (
            "stands",
            tuple[str, ...],
            parameter(
                (),
                "NAMESPACE[=STAND[@CALIBRATION]] of each stand: the namespace of its topics, the "
                "name of a shipped stand or the folder of one, and a calibration in place of its "
                "own",
                read_only=True,
            ),
        ),
        (
            MEMORY,
            str,
            parameter(
                EACH,
                "each: a file for each stand stores its verdict for a restart; none: no file",
                choices=(EACH, "none"),
                read_only=True,
            ),
        ),
        *_of_all(),
    ],
    frozen=True,
)


def values_of(entry: StandEntry, parameters: Any) -> dict[str, Any]:
    """Parameters of the diagnoser of one stand that differ from the defaults."""
    known = {each.name: each.default for each in fields(DIAGNOSER.parameters)}
    given = {name: getattr(parameters, name) for name in known if name not in OF_EACH}
    given |= {"stand": entry.stand, "calibration": entry.calibration}
    given[MEMORY] = "" if parameters.memory == EACH else parameters.memory
    return {name: value for name, value in given.items() if value != known[name]}
