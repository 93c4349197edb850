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

"""Program of a node that runs one stage."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, Protocol

from flea_diag import __version__
from flea_diag.nodes.stage.adapter import Adapter
from flea_diag.nodes.stage.compile_progress import CompileProgress
from flea_diag.nodes.stage.inbox import Turns
from flea_diag.nodes.stage.ports import StagePorts
from flea_diag.nodes.stage.verdict_memory import NONE, VerdictMemory
from flea_diag.stages import Stage
from flea_diag.wire.bus import Bus, Program
from flea_diag.wire.records import Health


class StageFactory(Protocol):
    """Builds a stage from its parameters; ``configuration.component`` has one for each node."""

    parameters: type

    def build(self, parameters: Any) -> Stage:
        """Fresh stage with these parameters."""
        ...

    def described(self, parameters: Any) -> str:
        """What it rests on, in one line for the log."""
        ...

    def check(self, parameters: Any) -> None:
        """Refuse parameters and files from which no stage can be built."""
        ...

    def warm_up(self, parameters: Any, begun: Callable[[str], None]) -> None:
        """Compile and load beforehand what would otherwise delay the first records.

        ``begun`` is called with the name of each function whose compilation begins.
        """
        ...


def stage_program(
    name: str,
    summary: str,
    component: StageFactory,
    ports: StagePorts,
    examples: tuple[str, ...] = (),
    shared: Turns | None = None,
) -> Program:
    """Program of a node that runs one stage; ``shared`` are the turns of its process's stands."""
    begin_s = time.monotonic()

    def prepare(bus: Bus[Any], parameters: Any) -> None:
        nonlocal begin_s
        begin_s = time.monotonic()
        bus.info(f"flea_diag {__version__}, stand {bus.stand}; {component.described(parameters)}")
        bus.info("warming up; the first start after an installation compiles for up to a minute")
        component.warm_up(parameters, CompileProgress(bus))

    def start(bus: Bus[Any], parameters: Any) -> None:
        memory = VerdictMemory(bus, getattr(parameters, "memory", NONE))
        turns = shared or _own_turns(bus, parameters)
        Adapter(bus, component.build, parameters, ports, memory, turns)
        topics = ", ".join(bus.full_name(kind) for kind in ports.subscribes)
        bus.info(f"ready after {time.monotonic() - begin_s:.1f} s, listening to {topics}")

    return Program(
        name,
        summary,
        component.parameters,
        start,
        ports.subscribes,
        (*ports.publishes, Health),
        examples,
        prepare,
        component.check,
    )


def _own_turns(bus: Bus[Any], parameters: Any) -> Turns | None:
    """Turns of a node alone: none, each message is handled as it comes, unless in batches."""
    batch_ms = getattr(parameters, "batch_ms", 0.0)
    return Turns(bus, batch_ms) if batch_ms else None
