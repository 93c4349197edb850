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

"""``ros2 run flea_diag diagnoser``: observer, isolator and extractor in one process."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flea_diag.wire.bus import Program

if TYPE_CHECKING:
    from flea_diag.nodes.stage.inbox import Turns


def program(shared: Turns | None = None) -> Program:
    """Description of this node; its slow imports come after the signal handlers are installed.

    ``shared`` are the turns of a process with several stands.
    """
    from flea_diag.configuration.component import DIAGNOSER
    from flea_diag.nodes.stage.ports import JUDGEMENTS, SOURCES, StagePorts
    from flea_diag.nodes.stage.program import stage_program
    from flea_diag.wire import records as r

    return stage_program(
        "diagnoser",
        "Runs observer, isolator and extractor in one process: scans and vibration in, ambiguity "
        "group out.",
        DIAGNOSER,
        StagePorts(
            subscribes=SOURCES,
            publishes=(r.VibrationLevel, *JUDGEMENTS),
        ),
        examples=(
            "ros2 run flea_diag diagnoser",
            "ros2 run flea_diag diagnoser --ros-args -r __ns:=/stand_2",
        ),
        shared=shared,
    )
