"""Connects a stage to the bus: subscribes to its inputs and publishes its outputs.

The stage decides. The adapter does what a live graph needs besides: it repeats the verdict every
second, marks it STALE when the source stops, reports health, and builds a fresh stage when stamps
jump back (a looping replay). It uses a node through the bus and is none itself.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Protocol

from flea_diag import __version__
from flea_diag.nodes.compile_progress import CompileProgress
from flea_diag.nodes.health import HealthReport
from flea_diag.nodes.inbox import Inbox, Turns
from flea_diag.nodes.malformed import with_malformed
from flea_diag.nodes.record_log import RecordLog
from flea_diag.nodes.stand_diagnostics import MIRRORED, mirrored
from flea_diag.nodes.verdict import NumberedVerdict
from flea_diag.nodes.verdict_memory import NONE, VerdictMemory
from flea_diag.stages import Stage
from flea_diag.stages.pipeline import Pipeline
from flea_diag.wire.blocks import Block, ScanBlock
from flea_diag.wire.bus import Bus, Program
from flea_diag.wire.records import (
    AmbiguityGroup,
    ChannelTable,
    DataQuality,
    Detection,
    FeatureRequest,
    FeatureValue,
    Health,
    Hypotheses,
    Record,
    Remark,
    Residual,
    Scan,
    Symbols,
    VibrationBlock,
    VibrationLevel,
)

JUDGEMENTS = (
    DataQuality,
    Residual,
    Detection,
    Symbols,
    FeatureRequest,
    FeatureValue,
    Hypotheses,
    AmbiguityGroup,
)

SOURCES: tuple[type, ...] = (ChannelTable, VibrationBlock, Scan, Remark)
"""Records that a stand and its operators publish; all other records follow from them."""

STREAMS: tuple[type, ...] = (VibrationBlock, Scan, Residual, VibrationLevel)
"""Records with increasing stamps. Latched records are excluded: they may be of any age."""

NUMBERS: tuple[type, ...] = (Residual, VibrationLevel)
"""Records of each scan or block: published, and neither logged nor repeated."""

SAID_ONCE: tuple[type, ...] = (ChannelTable, DataQuality, AmbiguityGroup)
"""State records, given to a fresh stage again."""

JUMP_NS = 1_000_000_000
"""Step back of the stamps from which on a new run is assumed."""

FOLLOWERS = 10
"""Consecutive records with such a step that start a new run; a single wrong stamp, or a second
source, does not."""

REPEAT_S = 1.0
WATCH_S = 0.1


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


@dataclass(frozen=True)
class StagePorts:
    """Record types that a node subscribes to and publishes, declared before it runs.

    ``sources_only`` is for stages composed in one process: the records that they exchange are
    published for operators and the recorder, and must not be read back from the bus.
    """

    subscribes: tuple[type, ...]
    publishes: tuple[type, ...]
    sources_only: bool = False


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
        component.warm_up(parameters, CompileProgress(bus.info))

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
        self._verdict = NumberedVerdict()
        self._health = HealthReport(bus)
        self._log = RecordLog(bus)
        self._latest_ns: dict[type, int] = {}
        self._held: list[Record] = []
        """Stream records received since their stamps stepped back, in order of arrival."""
        self._said_once: dict[type, Record] = {}
        self._mirrored: dict[type, Record] = {}
        self._quality: DataQuality | None = None
        """Data quality as the stage last said it."""
        self._malformed_said = 0
        self._memory = memory
        kept = memory.recall()
        if kept is not None:
            self._take(kept)
        bus.advertise(*ports.publishes, Health)
        inbox = None if turns is None else Inbox(bus, turns, self._take, self._take_block)
        for record_type in self._stage.consumes:
            if record_type in SOURCES or not ports.sources_only:
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
        for due in self._due(record):
            if isinstance(due, SAID_ONCE):
                self._said_once[type(due)] = due
            self._publish(self._stage.handle(due))

    def _take_block(self, block: ScanBlock) -> bool:
        """Handle scans at once; false, and nothing done, unless they go on where the last ended."""
        stamps_ns = block.stamps_ns.tolist()
        latest_ns = self._latest_ns.get(Scan, stamps_ns[0])
        rising = all(a < b for a, b in pairwise((latest_ns - 1, *stamps_ns)))
        if not isinstance(self._stage, Pipeline) or self._held or not rising:
            return False
        self._health.arrived(Scan, stamps_ns[0], late=False)
        self._health.taken()
        self._latest_ns[Scan] = stamps_ns[-1]
        self._publish(tuple(_singly(self._stage.handle_block(block))))
        return True

    def _publish(self, records: tuple[Record, ...]) -> None:
        for record in records:
            if isinstance(record, NUMBERS):
                self._bus.publish(record)
                continue
            if isinstance(record, AmbiguityGroup):
                record = self._verdict.changed(record, self._health.silent)
                self._memory.keep(record)
                if AmbiguityGroup in self._stage.consumes:
                    self._said_once[AmbiguityGroup] = record
                self._publish_verdict(record)
            elif isinstance(record, DataQuality):
                self._quality = record
                record = self._publish_quality(record)
            else:
                self._bus.publish(record)
            self._log.add(record)
            self._mirror(record)

    def _publish_quality(self, quality: DataQuality) -> DataQuality:
        """Publish data quality with what this node could not read, and return that."""
        whole = with_malformed(quality, self._bus.streams.values())
        self._malformed_said = self._malformed
        self._bus.publish(whole)
        return whole

    @property
    def _malformed(self) -> int:
        return sum(stream.malformed for stream in self._bus.streams.values())

    def _publish_verdict(self, group: AmbiguityGroup) -> None:
        for record in self._verdict.messages(group, self._bus.stand):
            self._bus.publish(record)

    def _mirror(self, record: Record) -> None:
        """Publish a changed state on /diagnostics; it is repeated every second."""
        if isinstance(record, MIRRORED):
            self._mirrored[type(record)] = record
            self._bus.publish(mirrored(record, self._bus.name, self._bus.now_ns()))

    def _due(self, record: Record) -> tuple[Record, ...]:
        """Records to handle now; a record that steps back waits until a new run is confirmed.

        A waiting record does not refresh the verdict of the previous run: it remains stale.
        """
        kind, stamp_ns = type(record), record.stamp_ns
        if kind not in STREAMS:
            return (record,)
        latest_ns = self._latest_ns.get(kind, stamp_ns)
        self._health.arrived(kind, stamp_ns, stamp_ns < latest_ns)
        if stamp_ns >= latest_ns - JUMP_NS:
            self._latest_ns[kind] = stamp_ns if stamp_ns > latest_ns else latest_ns
            self._health.taken()
            if not self._held:
                return (record,)
            refuted = [held for held in self._held if type(held) is kind]
            self._held = [held for held in self._held if type(held) is not kind]
            return (*refuted, record)
        self._held.append(record)
        if sum(type(held) is kind for held in self._held) < FOLLOWERS:
            return ()
        back_s = (latest_ns - stamp_ns) / 1e9
        self._bus.info(
            f"{kind.__name__} stamps stepped back by {back_s:.1f} s: diagnosis restarted"
        )
        return self._new_run()

    def _new_run(self) -> tuple[Record, ...]:
        """Restart the diagnosis with the records held back; all of them are due."""
        held, self._held = tuple(self._held), []
        self._forget_after(held[0].stamp_ns)
        self._start_afresh()
        self._health.taken()
        for record in held:
            self._latest_ns[type(record)] = record.stamp_ns
        return held

    def _forget_after(self, stamp_ns: int) -> None:
        """Drop state records newer than the first record of a new run: they are of the old run."""
        self._said_once = {
            kind: record for kind, record in self._said_once.items() if record.stamp_ns <= stamp_ns
        }

    def _start_afresh(self) -> None:
        self._stage = self._build(self._parameters)
        self._verdict.forget()
        self._quality = None
        self._latest_ns.clear()
        self._mirrored.clear()
        for kind in SAID_ONCE:
            if kind in self._said_once:
                self._publish(self._stage.handle(self._said_once[kind]))

    def _reconfigure(self, parameters: Any) -> None:
        self._parameters = parameters
        self._start_afresh()
        self._bus.info("parameters changed: diagnosis restarted")

    def _reset(self) -> str:
        records = self._stage.reset()  # type: ignore[attr-defined]
        self._publish(records)
        return f"episode closed, detection re-armed, {len(records)} records published"

    def _pause(self) -> None:
        """Mark the verdict stale: nothing is judged until the node is activated again."""
        self._bus.caution("deactivated: no record is judged until the node is activated again")
        changed = self._verdict.source_silent(True)
        if changed is not None:
            self._bus.publish(changed)
            self._mirror(changed)

    def _watch(self) -> None:
        self._health.check()
        if self._health.silent:
            # Without new records the watermark never passes those still waiting: release them.
            self._publish(getattr(self._stage, "finish", tuple)())
        changed = self._verdict.source_silent(self._health.silent)
        if changed is not None:
            self._publish_verdict(changed)
            if changed.stale:
                self._bus.caution("the source has stopped: the last verdict is repeated as stale")
            self._mirror(changed)

    def _repeat(self) -> None:
        if self._quality is not None and self._malformed > self._malformed_said:
            self._mirror(self._publish_quality(self._quality))
        again = self._verdict.again()
        if again is not None:
            self._publish_verdict(again)
        for record in self._mirrored.values():
            self._bus.publish(mirrored(record, self._bus.name, self._bus.now_ns()))
        self._bus.publish(self._health.record())


def _pipeline(stage: Stage) -> Pipeline:
    """The stage as one that takes any block."""
    return stage if isinstance(stage, Pipeline) else Pipeline((stage,))


def _singly(caused: tuple[Record | Block, ...]) -> Iterator[Record]:
    """Records one by one, as they are published."""
    for each in caused:
        if isinstance(each, Block):
            yield from each.records()
        else:
            yield each
