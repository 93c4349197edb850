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

"""``ros2 run flea_diag daq``: the simulated stand's DAQ, in real time on the bus."""

from __future__ import annotations

import math
import time
from collections import deque
from dataclasses import dataclass
from statistics import median
from typing import TYPE_CHECKING, Any

from flea_diag.errors import ConfigurationError, shown
from flea_diag.wire.bus import Bus, Consumers, Program, named
from flea_diag.wire.parameters import parameter
from flea_diag.wire.records import (
    AmbiguityGroup,
    ChannelTable,
    Health,
    Level,
    Record,
    Scan,
    Truth,
    VibrationBlock,
)

if TYPE_CHECKING:
    from flea_sim_driver.scenario.scenario import Scenario


PHASE = 0.3
"""Deadlines are this share of a tick early: at the tick, a jitter of 1 us would lose a tick."""
GRACE_S = 0.3
HEALTH_S = 1.0
SUBSCRIBERS_S = 10.0
LATE_S = 0.05
JITTER_SCANS = 6000
"""Scans over which the jitter is reported: one minute in real time."""
STREAMS = (VibrationBlock, Scan, ChannelTable)
PUBLISHES = (*STREAMS, Truth, Health)


@dataclass(frozen=True)
class DaqParameters:
    """Parameters of the DAQ node."""

    scenario: str = parameter(
        "nominal", "scenario that comes with the package, or a YAML file", read_only=True
    )
    machine: str = parameter(
        "", "simulated machine, by name or as a YAML file; empty: the scenario's", read_only=True
    )
    fault: str = parameter("", "fault to put in besides the scenario's own", read_only=True)
    fault_onset_s: float = parameter(
        8.0, "onset of that fault", unit="s", minimum=0.0, read_only=True
    )
    fault_size: float = parameter(
        0.0, "its size in the catalogue's unit, 0: the default", read_only=True
    )
    duration_s: float = parameter(
        0.0, "length of the run, 0: the scenario's", unit="s", minimum=0.0, read_only=True
    )
    rate: float = parameter(
        1.0, "speed: 1 is real time", minimum=0.05, maximum=1000.0, read_only=True
    )
    seed: int = parameter(-1, "of units and noise, -1: the scenario's", minimum=-1, read_only=True)
    wait_for_subscribers: int = parameter(
        0, "subscribers of sensors/slow to wait for, up to 10 s", minimum=0, read_only=True
    )
    wait_for: str = parameter(
        "",
        "nodes that must be active before the stand starts, such as diagnoser or "
        "observer,isolator,extractor; it ends once they have said their last verdict",
        read_only=True,
    )
    wait_s: float = parameter(
        300.0, "how long they are waited for", unit="s", minimum=0.0, read_only=True
    )
    publish_clock: bool = parameter(
        False, "be the clock of a graph with use_sim_time: publish /clock", read_only=True
    )
    command_topic: str = parameter(
        "",
        "topic of std_msgs/Float64 with the commanded position in m, such as the data bus of an "
        "aircraft; the last one is held while it is silent; empty: the scenario's motion",
        read_only=True,
    )
    load_topic: str = parameter(
        "", "the same of the commanded load in N; empty: the scenario's load", read_only=True
    )
    command_silent_s: float = parameter(
        1.0,
        "silence of a command topic after which health warns",
        unit="s",
        minimum=0.05,
        read_only=True,
    )
    inject: str = parameter(
        "",
        "fault to put in now: jam, jam:0.5 or actuator_position_bias:0.004@loop; empty clears all",
    )


@dataclass(frozen=True)
class InjectionRequest:
    """What ``inject`` asks for: a fault, its size (NaN: the default) and its place."""

    fault: str
    size: float
    where: str


def parsed_injection(text: str) -> InjectionRequest:
    """Of ``jam``, ``jam:0.5`` or ``actuator_position_bias:0.004@loop``.

    Raises
    ------
    ConfigurationError
        The size is no finite number.
    """
    named, _, where = text.partition("@")
    fault, colon, size = named.partition(":")
    try:
        value = float(size) if colon else math.nan
    except ValueError:
        value = math.inf
    if colon and not math.isfinite(value):
        raise ConfigurationError(
            f"inject = {shown(text)}: size {shown(size)} is no number, write for example jam:0.5"
        )
    return InjectionRequest(fault.strip(), value, where.strip())


class Daq:
    """Paces the blocks of a stand by absolute deadlines and publishes them.

    Parameters
    ----------
    bus
        Of the node.
    parameters
        At start; ``inject`` may change while it runs.
    """

    def __init__(self, bus: Bus[DaqParameters], parameters: DaqParameters) -> None:
        from flea_sim_driver.data_bus import DataBus
        from flea_sim_driver.stand import SimulatedStand

        self._bus, self._parameters = bus, parameters
        self._scenario = _scenario(parameters)
        topics = {"position": parameters.command_topic, "load": parameters.load_topic}
        self._data_bus = DataBus(bus, self._scenario, topics, parameters.command_silent_s)
        self._stand = SimulatedStand(self._scenario)
        self._tick_s = max(self._stand.scan_ns * 1e-9 / parameters.rate, 1e-3)
        self._due: deque[Record] = deque()
        self._published: dict[type, int] = dict.fromkeys(PUBLISHES, 0)
        self._begin: float | None = None
        self._paused_at: float | None = None
        self._worst_late_s = 0.0
        self._left_s: deque[float] = deque(maxlen=JITTER_SCANS)
        self._ended_at = math.inf
        self._injected = ""
        self._check_injection(parameters)
        bus.advertise(*PUBLISHES)
        self._consumers = Consumers(bus, named(parameters.wait_for), parameters.wait_s, STREAMS)
        self._given_up_at = time.monotonic() + SUBSCRIBERS_S
        bus.check_parameters(self._check_injection)
        bus.on_parameters(self._inject)
        bus.on("deactivate", self._pause)
        bus.on("activate", self._resume)
        bus.every(self._tick_s, self._tick)
        bus.every(HEALTH_S, self._report)

    def _awaited(self) -> bool:
        """Whether all who were to be waited for are there."""
        if not self._consumers.ready():
            return False
        wanted = self._parameters.wait_for_subscribers
        if self._bus.publishers.matched(Scan) >= wanted:
            return True
        if time.monotonic() < self._given_up_at:
            return False
        self._bus.warn(
            f"fewer than {wanted} subscribers of sensors/slow after {SUBSCRIBERS_S:g} s: starting"
        )
        return True

    def _begun(self, now: float) -> bool:
        """Whether the run has begun: with the first timer that finds everybody ready.

        The channel table goes out first, as the writers of the streams were announced before.
        """
        if not self._due:
            if not self._awaited():
                return False
            self._open()
        if not self._consumers.acknowledged(ChannelTable):
            return False
        self._begin = now - PHASE * self._tick_s
        self._inject(self._parameters)
        return True

    def _open(self) -> None:
        """A stand that begins now; what precedes its first scan is published."""
        from flea_sim_driver.stand import SimulatedStand

        # The DAQ stamps by its own clock; a stand that is itself the clock keeps its epoch.
        start = None if self._parameters.publish_clock else time.time_ns()
        self._stand = SimulatedStand(self._scenario, start, self._data_bus.command)
        run = self._scenario.run
        self._bus.info(f"{run.name}: {run.duration_s:g} s, seed {run.seed}")
        self._due.extend(sorted(self._stand.advance(), key=self._offset_ns))
        while isinstance(self._due[0], ChannelTable | Truth):
            self._send(self._due.popleft(), 0)

    def _pause(self) -> None:
        self._paused_at = time.monotonic()
        self._bus.caution("deactivated: the stand pauses until the node is activated again")

    def _resume(self) -> None:
        """Go on where the stand paused; its time has stood still."""
        if self._paused_at is not None and self._begin is not None:
            self._begin += time.monotonic() - self._paused_at
        self._paused_at = None

    def _check_injection(self, parameters: DaqParameters) -> None:
        """Refuse an impossible fault, so that setting the parameter fails with the reason."""
        if parameters.inject not in ("", self._injected):
            asked = parsed_injection(parameters.inject)
            self._stand.injection(asked.fault, asked.size, where=asked.where)

    def _inject(self, parameters: DaqParameters) -> None:
        self._parameters = parameters
        if self._begin is None or parameters.inject == self._injected:
            return
        self._injected = parameters.inject
        self._stand.clear()
        if not parameters.inject:
            self._bus.info("faults cleared")
            return
        asked = parsed_injection(parameters.inject)
        truth = self._stand.inject(asked.fault, asked.size, where=asked.where)
        self._bus.info(f"injecting {truth.fault}")

    def _tick(self) -> None:
        """Publish all records that are due; compute the next block half a block ahead."""
        now = time.monotonic()
        if self._begin is None and not self._begun(now):
            return
        assert self._begin is not None
        elapsed_ns = int((now - self._begin) * self._parameters.rate * 1e9)
        while self._due and self._offset_ns(self._due[0]) <= elapsed_ns:
            self._send(self._due.popleft(), elapsed_ns)
            if not self._due:
                self._refill(elapsed_ns)
        self._refill(elapsed_ns)
        if not self._due and self._stand.finished:
            self._ended_at = min(self._ended_at, now)
            if now > self._ended_at + GRACE_S and self._consumers.done():
                self._bus.end()

    def _refill(self, elapsed_ns: int) -> None:
        ahead_ns = 50_000_000
        if self._stand.finished:
            return
        if not self._due or self._stand.time_s * 1e9 <= elapsed_ns + ahead_ns:
            # A block of vibration is sent after the scans that it spans.
            self._due.extend(sorted(self._stand.advance(), key=self._offset_ns))

    def _offset_ns(self, record: Record) -> int:
        """When a record leaves the DAQ: once all of its samples have been taken."""
        span = {Scan: self._stand.scan_ns, VibrationBlock: 100_000_000}.get(type(record), 0)
        return record.stamp_ns + span - self._stand.start_ns

    def _send(self, record: Record, elapsed_ns: int) -> None:
        late_s = (elapsed_ns - self._offset_ns(record)) / 1e9 / self._parameters.rate
        self._worst_late_s = max(self._worst_late_s, late_s)
        if self._parameters.publish_clock and isinstance(record, Scan):
            self._bus.publish_clock(record.stamp_ns)
        self._bus.publish(record)
        self._published[type(record)] += 1
        if isinstance(record, Scan) and self._begin is not None:
            due_s = self._offset_ns(record) / 1e9 / self._parameters.rate
            self._left_s.append(time.monotonic() - self._begin - due_s)

    def _report(self) -> None:
        late = self._worst_late_s
        self._worst_late_s = 0.0
        wrong = [f"{late:.3f} s behind its clock"] if late >= LATE_S else []
        wrong += self._data_bus.wrong()
        level, message = (Level.WARN, "; ".join(wrong)) if wrong else (Level.OK, "streaming")
        values = (
            ("state", self._bus.state),
            ("scans", str(self._published[Scan])),
            ("vibration_blocks", str(self._published[VibrationBlock])),
            ("worst_late_ms", f"{late * 1e3:.2f}"),
            ("jitter_p99_ms", f"{self._jitter_s() * 1e3:.2f}"),
            ("inject", self._injected),
            *self._data_bus.values(),
        )
        self._bus.publish(Health(self._bus.now_ns(), self._bus.name, level, message, values))

    def _jitter_s(self) -> float:
        """99th percentile of the deviation of the latest scans from their nominal time."""
        if not self._left_s:
            return 0.0
        usual = median(self._left_s)
        apart = sorted(abs(left - usual) for left in self._left_s)
        return apart[int(0.99 * (len(apart) - 1))]


def _scenario(parameters: DaqParameters) -> Scenario:
    """The scenario, with the parameters overriding its settings."""
    from flea_sim_driver.scenario.library import find_scenario
    from flea_sim_driver.scenario.scenario_file import overridden

    run: dict[str, Any] = {}
    if parameters.duration_s > 0.0:
        run["duration_s"] = parameters.duration_s
    if parameters.seed >= 0:
        run["seed"] = parameters.seed
    fault = {
        "fault": parameters.fault,
        "onset_s": parameters.fault_onset_s,
        "size": parameters.fault_size or math.nan,
    }
    found = find_scenario(parameters.scenario, parameters.machine)
    return overridden(found, parameters.scenario, run, fault if parameters.fault else None)


def check(parameters: DaqParameters) -> None:
    """Refuse a scenario or fault that the stand cannot run."""
    from flea_sim_driver.stand import SimulatedStand

    stand = SimulatedStand(_scenario(parameters))
    if parameters.inject:
        asked = parsed_injection(parameters.inject)
        stand.injection(asked.fault, asked.size, where=asked.where)


def program() -> Program:
    """Describe this node for ``--help``."""

    def prepare(bus: Bus[Any], parameters: Any) -> None:
        """Compile and load before the first deadline, on a stand that is not published."""
        from flea_sim_driver.stand import SimulatedStand

        bus.info("warming up; the first start after an installation compiles for some seconds")
        SimulatedStand(_scenario(parameters)).advance()

    def start(bus: Bus[Any], parameters: Any) -> None:
        Daq(bus, parameters)

    return Program(
        "daq",
        "The simulated stand: runs a scenario and publishes what its DAQ measures.",
        DaqParameters,
        start,
        subscribes=(AmbiguityGroup,),
        publishes=PUBLISHES,
        examples=(
            "ros2 run flea_diag daq --ros-args -p scenario:=jam",
            "ros2 run flea_diag daq --ros-args -p fault:=winding_short -p fault_onset_s:=5.0",
            "ros2 param set /daq inject jam:0.5     (while it runs; '' clears)",
            "ros2 run flea_diag daq --ros-args -p command_topic:=bus/aileron -p duration_s:=3600.0",
        ),
        prepare=prepare,
        check=check,
    )
