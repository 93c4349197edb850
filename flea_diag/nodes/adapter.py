"""Puts any stage on the bus: subscribes to what it consumes, publishes what it returns.

Has a node, is not a node. The stage decides; the adapter keeps what belongs to the live graph:
the verdict repeated each second, STALE when the source stops, health, and a fresh stage when
stamps jump back (a replay that loops).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

from flea_diag.nodes.health import HealthReport
from flea_diag.nodes.stand_diagnostics import MIRRORED, mirrored
from flea_diag.nodes.verdict import NumberedVerdict
from flea_diag.nodes.verdict_memory import NONE, VerdictMemory
from flea_diag.stages import Stage
from flea_diag.wire.bus import Bus, Program
from flea_diag.wire.records import (
    AmbiguityGroup,
    ChannelTable,
    DataQuality,
    Detection,
    FeatureRequest,
    FeatureValue,
    Health,
    Record,
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
    AmbiguityGroup,
)

SOURCES: tuple[type, ...] = (ChannelTable, VibrationBlock, Scan)
"""What a stand publishes; all else is caused by it."""

STREAMS: tuple[type, ...] = (VibrationBlock, Scan, Residual, VibrationLevel)
"""Records whose stamps only grow. A latched record is as old as it likes to be."""

SAID_ONCE: tuple[type, ...] = (ChannelTable, DataQuality, AmbiguityGroup)
"""Records of how things stand: a fresh stage is told them again."""

JUMP_NS = 1_000_000_000
"""Stamps that are older than the stream by more than this start a new run."""

FOLLOWERS = 10
"""So many of them in a row: one wrong stamp, or a second source, does not."""

REPEAT_S = 1.0
WATCH_S = 0.1


class StageFactory(Protocol):
    """A stage that can be built: ``flea_diag.configuration`` names one for each node."""

    parameters: type

    def build(self, parameters: Any) -> Stage:
        """Fresh stage with these parameters."""
        ...

    def warm_up(self, parameters: Any) -> None:
        """Do beforehand what else the first records would wait for."""
        ...


@dataclass(frozen=True)
class StagePorts:
    """What a node takes and gives, declared before it runs.

    ``sources_only`` is for stages composed in one process: what they hand to each other is
    published for people and the recorder, and must not come back to them from the bus.
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
) -> Program:
    """Program of a node that is one stage on the bus."""

    def start(bus: Bus[Any], parameters: Any) -> None:
        component.warm_up(parameters)
        memory = getattr(parameters, "memory", NONE)
        Adapter(bus, component.build, parameters, ports, VerdictMemory(bus, memory))

    return Program(
        name,
        summary,
        component.parameters,
        start,
        ports.subscribes,
        (*ports.publishes, Health),
        examples,
    )


class Adapter:
    """One stage and the bus that it lives on.

    Parameters
    ----------
    bus
        Of the node.
    build
        Makes a fresh stage of parameters; called again when stamps have jumped back and when a
        parameter changes.
    parameters
        Values at start.
    ports
        Topics to advertise, and whether only the stand's own are taken.
    memory
        Of the verdict, for a stage whose own verdict tells it of the past.
    """

    def __init__(
        self,
        bus: Bus[Any],
        build: Callable[[Any], Stage],
        parameters: Any,
        ports: StagePorts,
        memory: VerdictMemory,
    ) -> None:
        self._bus = bus
        self._build = build
        self._parameters = parameters
        self._stage = build(parameters)
        self._verdict = NumberedVerdict()
        self._health = HealthReport(bus)
        self._latest_ns: dict[type, int] = {}
        self._held: list[Record] = []
        """Those of streams whose stamps have jumped back, in the order of arrival."""
        self._said_once: dict[type, Record] = {}
        self._mirrored: dict[type, Record] = {}
        self._memory = memory
        kept = memory.recall()
        if kept is not None:
            self._take(kept)
        bus.advertise(*ports.publishes, Health)
        for record_type in self._stage.consumes:
            if record_type in SOURCES or not ports.sources_only:
                bus.subscribe(record_type, self._take)
        if hasattr(self._stage, "reset"):
            bus.serve_trigger("~/reset", self._reset)
        bus.on_parameters(self._reconfigure)
        bus.every(WATCH_S, self._watch)
        bus.every(REPEAT_S, self._repeat)

    def _take(self, record: Record) -> None:
        for due in self._due(record):
            if isinstance(due, SAID_ONCE):
                self._said_once[type(due)] = due
            self._publish(self._stage.handle(due))

    def _publish(self, records: tuple[Record, ...]) -> None:
        for record in records:
            if isinstance(record, AmbiguityGroup):
                record = self._verdict.changed(record, self._health.silent)
                self._memory.keep(record)
                if AmbiguityGroup in self._stage.consumes:
                    self._said_once[AmbiguityGroup] = record
            self._bus.publish(record)
            self._mirror(record)

    def _mirror(self, record: Record) -> None:
        """Tell people's tools what has changed; it is repeated each second."""
        if isinstance(record, MIRRORED):
            self._mirrored[type(record)] = record
            self._bus.publish(mirrored(record, self._bus.name, self._bus.now_ns()))

    def _due(self, record: Record) -> tuple[Record, ...]:
        """What is to be taken now; what jumps back waits until it is known for a new run."""
        kind = type(record)
        if kind not in STREAMS:
            return (record,)
        latest_ns = self._latest_ns.get(kind, record.stamp_ns)
        self._health.arrived(kind, record.stamp_ns, late=record.stamp_ns < latest_ns)
        if record.stamp_ns >= latest_ns - JUMP_NS:
            self._latest_ns[kind] = max(record.stamp_ns, latest_ns)
            refuted = [held for held in self._held if type(held) is kind]
            self._held = [held for held in self._held if type(held) is not kind]
            return (*refuted, record)
        self._held.append(record)
        if sum(type(held) is kind for held in self._held) < FOLLOWERS:
            return ()
        back_s = (latest_ns - record.stamp_ns) / 1e9
        self._bus.info(f"{kind.__name__} stamps went back by {back_s:.1f} s: starting afresh")
        return self._new_run()

    def _new_run(self) -> tuple[Record, ...]:
        """Start afresh with what was held; all of it is due."""
        held, self._held = tuple(self._held), []
        self._forget_after(held[0].stamp_ns)
        self._start_afresh()
        for record in held:
            self._latest_ns[type(record)] = record.stamp_ns
        return held

    def _forget_after(self, stamp_ns: int) -> None:
        """What is younger than a new run's first record belongs to the run before."""
        self._said_once = {
            kind: record for kind, record in self._said_once.items() if record.stamp_ns <= stamp_ns
        }

    def _start_afresh(self) -> None:
        self._stage = self._build(self._parameters)
        self._verdict.forget()
        self._latest_ns.clear()
        self._mirrored.clear()
        for kind in SAID_ONCE:
            if kind in self._said_once:
                self._publish(self._stage.handle(self._said_once[kind]))

    def _reconfigure(self, parameters: Any) -> None:
        self._parameters = parameters
        self._start_afresh()
        self._bus.info("parameters changed: starting afresh")

    def _reset(self) -> str:
        records = self._stage.reset()  # type: ignore[attr-defined]
        self._publish(records)
        return f"episode closed and re-armed, {len(records)} records published"

    def _watch(self) -> None:
        if self._health.silent:
            # Records that wait for a watermark would wait for ever.
            self._publish(getattr(self._stage, "finish", tuple)())
        changed = self._verdict.source_silent(self._health.silent)
        if changed is not None:
            self._bus.publish(changed)
            self._mirror(changed)

    def _repeat(self) -> None:
        again = self._verdict.again()
        if again is not None:
            self._bus.publish(again)
        for record in self._mirrored.values():
            self._bus.publish(mirrored(record, self._bus.name, self._bus.now_ns()))
        self._bus.publish(self._health.record())
