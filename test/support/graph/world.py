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

"""A stand, its diagnosis, a recorder and what goes wrong around them, drawn from one seed."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from flea_diag.nodes.recording import recorder
from flea_diag.nodes.stage_nodes import diagnoser, extractor, isolator, observer
from flea_diag.wire.bus import Program, qos
from flea_diag.wire.bus.life_cycle import ACTIVATE, CLEANUP, CONFIGURE, DEACTIVATE
from flea_diag.wire.messages import codec
from flea_diag.wire.records import ChannelTable, Scan
from flea_diag.wire.topics import TOPIC_OF
from support.disk.failing_disk import FULL, FailingDisk
from support.graph.network import Network, Reader, Writer
from support.graph.process import GraphProcess
from support.graph.ros_node import RosNode
from support.graph.runs import PERIOD_NS, Run, run_of
from support.graph.scheduler import START_NS, S, Scheduler
from support.graph.spoilt_source import SPOILT, sent

BEGIN_S = 1.0
"""Until the source sends: nodes know each other by then."""
END_S = 3.0
"""After the last scan: until it is known that the source has stopped."""
UNITS = 24
LOOK_NS = 500_000_000
"""Until a recorder writes again."""
BUSY_NS = (200_000, 2_000_000)
"""Time that a callback takes."""
LAYOUTS: tuple[tuple[Callable[..., Program], ...], ...] = (
    (diagnoser,),
    (observer, isolator, extractor),
)


@dataclass
class World:
    """One graph; ``troubles`` act on it while it runs."""

    seed: int
    folder: Path
    run: Run
    scheduler: Scheduler
    network: Network
    disk: FailingDisk
    spoilt: tuple[str, ...] = ()
    troubles: tuple[str, ...] = ()
    processes: dict[str, GraphProcess] = field(default_factory=dict)
    said: list[tuple[int, str, bytes]] = field(default_factory=list)
    """Everything that was published by the diagnosis: time, topic, bytes."""
    taken: list[tuple[str, bytes, int]] = field(default_factory=list)
    """Everything that the recorder was given: topic, bytes, time."""
    trace: Any = field(default_factory=hashlib.sha256)
    full: bool = False
    """Whether the disk is."""
    programs: dict[str, Program] = field(default_factory=dict)
    layout: tuple[Callable[..., Program], ...] = ()
    """How the diagnosis is dealt to processes; empty: it is drawn."""
    recorders: list[Any] = field(default_factory=list)
    """Buses of all recorders so far."""
    recorder_ends_ns: list[int] = field(default_factory=list)
    """When a recorder was killed, or its disk was full."""
    begun_ns: int = START_NS

    @property
    def words(self) -> str:
        """What is drawn, in words."""
        of = self.run.fault or "healthy"
        return f"{of}; {' + '.join(self.spoilt + self.troubles) or 'nothing'} "

    @property
    def foreign(self) -> int:
        """Messages that the recorders have counted as those of a second source."""
        return sum(s.foreign for bus in self.recorders for s in bus.streams.values())

    def start(self) -> None:
        """Start all processes and the source."""
        self.network.heard = self._heard
        self.network.took = self._took
        draw = self.scheduler.random
        layout = self.layout or LAYOUTS[draw.randrange(len(LAYOUTS))]
        made = [make() for make in (*layout, recorder.program)]
        self.programs = {program.name: program for program in made}
        for name in self.programs:
            self.begin(name)
        self._source("stand", self.run, self.spoilt, self.begun_ns + round(BEGIN_S * S))
        for name in self.troubles:
            TROUBLES[name](self)

    def begin(self, name: str, activate: bool = True) -> None:
        """Start a process, or start it again."""
        number = sum(each.name.startswith("bag") for each in self.folder.iterdir())
        values = {
            **{
                judge: {"memory": str(self.folder / f"{judge}.cdr")}
                for judge in ("diagnoser", "isolator")
            },
            "recorder": {"directory": str(self.folder / f"bag_{number}"), "stop_free_mb": 0},
        }
        self.processes[name] = GraphProcess(
            self.network, self.programs[name], values.get(name, {}), self._cost, activate
        )
        if name == "recorder":
            self.recorders.append(self.processes[name].bus)

    def _cost(self) -> int:
        return self.scheduler.random.randint(*BUSY_NS)

    def _source(self, name: str, run: Run, spoilt: tuple[str, ...], from_ns: int) -> None:
        """A node that publishes a run, at its pace."""
        node = RosNode(self.network, name)
        table, scans = (
            node.create_publisher(
                None, TOPIC_OF[kind].name, qos.reliable(100, TOPIC_OF[kind].latched)
            )
            for kind in (ChannelTable, Scan)
        )
        table.publish(codec.encode(replace(run.table, stamp_ns=from_ns)))
        for at_ns, scan in sent(run, spoilt, self.scheduler.random):
            data = codec.encode(replace(scan, stamp_ns=scan.stamp_ns + from_ns))
            self.scheduler.at(from_ns + at_ns, lambda data=data: scans.publish(data))

    def beside(self, name: str, run: Run, late_ns: int) -> None:
        """A second source, later than the first."""
        from_ns = self.begun_ns + round(BEGIN_S * S) + late_ns
        self.scheduler.at(from_ns, lambda: self._source(name, run, (), from_ns))

    def some_time(self) -> float:
        """Seconds from now to a moment well within the run."""
        last_s = self.run.scans[-1].stamp_ns / S
        return BEGIN_S + self.scheduler.random.uniform(0.2, 0.8) * last_s

    def _heard(self, writer: Writer, message: Any) -> None:
        if isinstance(message, bytes) and writer.topic != "/diagnostics":
            self.trace.update(b"%d %s " % (self.scheduler.now_ns, writer.topic.encode()))
            self.trace.update(message)
            if not writer.topic.startswith("/sensors"):
                self.said.append((self.scheduler.now_ns, writer.topic, message))

    def _took(self, reader: Reader, message: Any) -> None:
        if reader.node.get_name() == "recorder" and isinstance(message, bytes):
            self.taken.append((reader.topic, message, self.scheduler.wall_ns))

    def finish(self) -> None:
        """Run to the end, and end all processes in order."""
        last_ns = self.run.scans[-1].stamp_ns
        self.scheduler.run_until(self.begun_ns + round((BEGIN_S + END_S) * S) + last_ns)
        for process in self.processes.values():
            process.end()


def _any_stage(world: World) -> str:
    return world.scheduler.random.choice([n for n in world.programs if n != "recorder"])


def killed(world: World) -> None:
    """A process of the diagnosis is killed and comes back."""
    name = _any_stage(world)

    def die() -> None:
        world.processes[name].kill()
        world.scheduler.after(world.scheduler.random.uniform(0.5, 3.0), lambda: world.begin(name))

    world.scheduler.after(world.some_time(), die)


def recorder_killed(world: World) -> None:
    """The recorder is killed and comes back, with a bag of its own."""

    def die() -> None:
        world.processes["recorder"].kill()
        world.recorder_ends_ns.append(world.scheduler.wall_ns)
        world.scheduler.after(1.0, lambda: world.begin("recorder"))

    world.scheduler.after(world.some_time(), die)


def stalled(world: World) -> None:
    """A node is held up for a while."""
    names = list(world.programs)
    name, held_s = world.scheduler.random.choice(names), world.scheduler.random.uniform(0.3, 4.0)

    def hold() -> None:
        world.processes[name].node.busy_until_ns = world.scheduler.now_ns + round(held_s * S)

    world.scheduler.after(world.some_time(), hold)


def paused(world: World) -> None:
    """A node is deactivated and activated again."""
    _changed(world, (DEACTIVATE, ACTIVATE))


def configured_again(world: World) -> None:
    """A node goes through its whole life cycle, as under a manager."""
    _changed(world, (DEACTIVATE, CLEANUP, CONFIGURE, ACTIVATE))


def _changed(world: World, transitions: tuple[str, ...]) -> None:
    name, at_s = _any_stage(world), world.some_time()
    for number, transition in enumerate(transitions):

        def change(transition: str = transition) -> None:
            if world.processes[name].running:
                world.processes[name].change(transition)

        world.scheduler.after(at_s + 0.7 * number, change)


def lossy_links(world: World) -> None:
    """A hundredth of all messages does not arrive."""
    draw = world.scheduler.random
    world.network.loses = lambda writer, reader: not writer.latched and draw.random() < 0.01


def slow_links(world: World) -> None:
    """Messages are held up by up to half a second."""
    draw = world.scheduler.random
    world.network.delay_ns = lambda writer: draw.randint(100_000, 500_000_000)


def second_source(world: World) -> None:
    """Another stand publishes on the same topics, 5 ms beside the first."""
    draw = world.scheduler.random
    world.beside("other_stand", run_of(draw.randrange(UNITS)), draw.randrange(S) * 10 + 5_000_000)


def old_bag(world: World) -> None:
    """A bag of 2010 is played at five times its pace beside the live stand."""
    old = run_of(world.scheduler.random.randrange(UNITS))
    begin_ns = round(world.some_time() * S)
    node = RosNode(world.network, "player")
    topic = TOPIC_OF[Scan]
    writer = node.create_publisher(None, topic.name, qos.reliable(100, topic.latched))
    for number, scan in enumerate(old.scans):
        data = codec.encode(replace(scan, stamp_ns=1_262_300_000 * S + scan.stamp_ns))
        at_ns = world.scheduler.now_ns + begin_ns + number * PERIOD_NS // 5
        world.scheduler.at(at_ns, lambda data=data: writer.publish(data))


def host_clock_set(world: World) -> None:
    """Somebody sets the clock of the host, by up to a minute."""
    by_ns = world.scheduler.random.randrange(-60 * S, 60 * S)
    world.scheduler.after(world.some_time(), lambda: setattr(world.scheduler, "set_ns", by_ns))


def disk_full(world: World) -> None:
    """The disk is full from a moment on."""

    def fill() -> None:
        world.full = True
        world.recorder_ends_ns.append(world.scheduler.wall_ns + LOOK_NS)

    world.scheduler.after(world.some_time(), fill)


TROUBLES: dict[str, Callable[[World], None]] = {
    each.__name__: each
    for each in (
        killed, recorder_killed, stalled, paused, configured_again, lossy_links, slow_links,
        second_source, old_bag, host_clock_set, disk_full,
    )
}  # fmt: skip


def drawn(seed: int, folder: Path) -> World:
    """The graph of a seed: a run, and up to three things that go wrong."""
    scheduler = Scheduler(seed)
    draw = scheduler.random
    run = run_of(draw.randrange(UNITS))
    names = draw.sample([*SPOILT, *TROUBLES], draw.randrange(4))
    world = World(
        seed, folder, run, scheduler, Network(scheduler),
        FailingDisk(folder, lambda _number, _name: FULL if world.full else 0),
        tuple(name for name in SPOILT if name in names),
        tuple(name for name in TROUBLES if name in names),
    )  # fmt: skip
    return world
