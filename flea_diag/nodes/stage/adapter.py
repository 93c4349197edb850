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

"""Connects a stage to the bus: subscribes to its inputs and publishes its outputs.

The stage decides. The adapter does what a live graph needs besides: it repeats the verdict every
second, marks it STALE when the source stops, reports health, and builds a fresh stage when stamps
jump back (a looping replay). It uses a node through the bus and is none itself.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flea_diag.nodes.health import HealthReport
from flea_diag.nodes.stage.inbox import Inbox, Turns
from flea_diag.nodes.stage.output import StageOutput
from flea_diag.nodes.stage.ports import StagePorts
from flea_diag.nodes.stage.stream_stamps import STREAMS, StreamStamps
from flea_diag.nodes.stage.verdict_memory import VerdictMemory
from flea_diag.stages import Stage
from flea_diag.stages.pipeline import Pipeline
from flea_diag.wire.blocks import ScanBlock
from flea_diag.wire.bus import Bus
from flea_diag.wire.records import AmbiguityGroup, ChannelTable, DataQuality, Health, Record

SAID_ONCE: tuple[type, ...] = (ChannelTable, DataQuality, AmbiguityGroup)
"""State records, given to a fresh stage again."""

REPEAT_S = 1.0
WATCH_S = 0.1
UNHEARD_S = 5
"""Seconds after which a node that has had no record says so in its log."""


class Adapter:
    """Connects one stage to the bus of its node.

    Parameters
    ----------
    bus
        Bus of the node.
    build
        Builds a fresh stage from parameters; called again after a step back of the stamps and
        after a change of parameters.
    parameters
        Values at start.
    ports
        Topics to advertise, and whether only the stand's own topics are subscribed to.
    memory
        Stored verdict, from which a restarted diagnosis resumes.
    turns
        Where messages wait for their turn; None: each is handled as it arrives.
    """

    def __init__(
        self,
        bus: Bus[Any],
        build: Callable[[Any], Stage],
        parameters: Any,
        ports: StagePorts,
        memory: VerdictMemory,
        turns: Turns | None = None,
    ) -> None:
        self._bus = bus
        self._build = build if turns is None else lambda values: _pipeline(build(values))
        self._parameters = parameters
        self._stage = self._build(parameters)
        self._memory = memory
        self._waited = 0
        """Seconds without a first record."""
        self._reads = tuple(filter(ports.reads, self._stage.consumes))
        self._health = HealthReport(bus)
        self._stamps = StreamStamps(self._health, self._new_run)
        self._output = StageOutput(bus, self._health, self._keep)
        self._said_once: dict[type, Record] = {}
        kept = memory.recall()
        if kept is not None:
            self._take(kept)
        bus.advertise(*ports.publishes, Health)
        inbox = None if turns is None else Inbox(bus, turns, self._take, self._take_block)
        for record_type in self._reads:
            if inbox is None:
                bus.subscribe(record_type, self._take)
            else:
                inbox.subscribe(record_type)
        if hasattr(self._stage, "reset"):
            bus.serve_trigger("~/reset", self._reset)
        bus.on_parameters(self._reconfigure)
        bus.on("deactivate", self._pause)
        bus.every(WATCH_S, self._watch)
        bus.every(REPEAT_S, self._repeat)

    def _take(self, record: Record) -> None:
        if isinstance(record, ChannelTable) and self._is_of_another(record):
            return
        for due in self._stamps.due(record):
            if isinstance(due, SAID_ONCE):
                self._said_once[type(due)] = due
            if isinstance(due, ChannelTable):
                self._output.take_table(due)
            self._output.publish(self._stage.handle(due))

    def _take_block(self, block: ScanBlock) -> bool:
        """Handle scans at once; false, and nothing done, unless they go on where the last ended."""
        if not isinstance(self._stage, Pipeline):
            return False
        if not self._stamps.goes_on(block.stamps_ns.tolist()):
            return False
        self._output.publish(self._stage.handle_block(block))
        return True

    def _is_of_another(self, table: ChannelTable) -> bool:
        """Whether an older table comes from a second source, such as a bag beside a live stand."""
        known = self._said_once.get(ChannelTable)
        if known is None or table.stamp_ns >= known.stamp_ns:
            return False
        sources = self._bus.sources(ChannelTable)
        if len(sources) < 2:
            return False
        self._bus.warn(
            f"sensors/channels: published by {', '.join(sources)}: a table older than the one in "
            "use is not used"
        )
        return True

    def _keep(self, verdict: AmbiguityGroup) -> None:
        """Keep a verdict for the time after a restart, of the node or of the diagnosis."""
        self._memory.keep(verdict)
        if AmbiguityGroup in self._stage.consumes:
            self._said_once[AmbiguityGroup] = verdict

    def _new_run(self, why: str, from_ns: int) -> None:
        """Restart the diagnosis; what is newer than the run's first record is of the old run."""
        self._bus.info(f"{why}: diagnosis restarted")
        self._said_once = {
            kind: record for kind, record in self._said_once.items() if record.stamp_ns <= from_ns
        }
        self._start_afresh()

    def _start_afresh(self) -> None:
        self._stage = self._build(self._parameters)
        self._output.forget()
        self._stamps.forget()
        for kind in SAID_ONCE:
            if kind in self._said_once:
                self._output.publish(self._stage.handle(self._said_once[kind]))

    def _reconfigure(self, parameters: Any) -> None:
        self._parameters = parameters
        self._start_afresh()
        self._bus.info("parameters changed: diagnosis restarted")

    def _reset(self) -> str:
        records = self._stage.reset()  # type: ignore[attr-defined]
        self._output.publish(records)
        return f"episode closed, detection re-armed, {len(records)} records published"

    def _pause(self) -> None:
        """Mark the verdict stale: nothing is judged until the node is activated again."""
        self._bus.caution("deactivated: no record is judged until the node is activated again")
        self._output.pause()

    def _watch(self) -> None:
        self._health.check()
        if self._health.silent:
            # Without new records the watermark never passes those still waiting: release them.
            self._output.publish(getattr(self._stage, "finish", tuple)())
        self._output.note_silence()

    def _repeat(self) -> None:
        self._waited += self._health.waiting
        if self._waited == UNHEARD_S:
            self._waited += 1
            self._tell_unheard()
        self._output.repeat(getattr(self._stage, "report", lambda: None)())
        self._bus.publish(self._health.record())

    def _tell_unheard(self) -> None:
        """Say once which topic brings nothing: a name or a namespace is easily another one."""
        streams = [kind for kind in self._reads if kind in STREAMS]
        nobody = [kind for kind in streams if not self._bus.writers(kind)]
        topics = ", ".join(map(self._bus.full_name, nobody or streams))
        why = "which nobody publishes" if nobody else "which is published, and brings nothing"
        self._bus.caution(
            f"no record yet on {topics}, {why}: check that its source runs, and names and "
            "namespaces (ros2 topic info)"
        )


def _pipeline(stage: Stage) -> Pipeline:
    """The stage as one that takes any block."""
    return stage if isinstance(stage, Pipeline) else Pipeline((stage,))
