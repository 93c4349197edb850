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

"""The bus of one node: records out and in, timers, services, and how it ends.

Messages are passed to rclpy as the bytes of the codec: ``publish(bytes)`` and raw subscriptions
cost one memcpy, whereas a message object costs up to 1 ms.
"""

from __future__ import annotations

import time
from collections import defaultdict, deque
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Generic, TypeVar

from flea_diag.errors import FleaError
from flea_diag.wire.blocks import ResidualBlock
from flea_diag.wire.bus import qos
from flea_diag.wire.bus.declared import Declared
from flea_diag.wire.bus.foreign_topic import advertise_foreign, subscribe_foreign
from flea_diag.wire.bus.life_cycle import ACTIVE, INACTIVE, UNCONFIGURED
from flea_diag.wire.bus.node_log import NodeLog
from flea_diag.wire.bus.publishers import Publishers
from flea_diag.wire.bus.reader import Reader, sources_of
from flea_diag.wire.bus.remote.node_states import NodeStates
from flea_diag.wire.bus.remote.remote_parameter import RemoteParameter
from flea_diag.wire.bus.remote.remote_service import RemoteService
from flea_diag.wire.bus.subscription import Subscription
from flea_diag.wire.messages import codec
from flea_diag.wire.records import Health, Record, Residual
from flea_diag.wire.topics import TOPIC_OF, Topic

P = TypeVar("P")

POLL_S = 0.02
LOOK_S = 1.0
"""Period at which writers are looked for that offer less than is asked for."""

OWN_STAMPS = 64
"""Stamps of its own reports that a node knows again."""

SILENT = (UNCONFIGURED, INACTIVE)
"""States in which a node publishes nothing but its health."""

READER_DEPTH = 100
"""Queue length of a reader of a latched topic. The writer keeps one sample for late joiners, but
changes may arrive in a burst, of which a reader with one slot would lose all but the last."""


class Bus(NodeLog, Generic[P]):
    """The part of ROS that a program needs; wraps a node.

    Parameters
    ----------
    node, executor
        Node and executor of rclpy; the node is already added to the executor.
    declared
        Parameters of the node.
    finished
        Future whose completion ends the program.
    """

    def __init__(self, node: Any, executor: Any, declared: Declared[P], finished: Any) -> None:
        super().__init__(node)
        self._executor = executor
        self._declared = declared
        self._finished = finished
        self.publishers = Publishers(node, self.topic_name)
        self._readers: dict[type, Reader] = {}
        self._clock: Any = None
        self._hooks: defaultdict[str, list[Callable[[], None]]] = defaultdict(list)
        self._own_stamps: deque[int] = deque(maxlen=OWN_STAMPS)
        self.doing = ""
        """What takes long before the node is ready, in words."""
        self.state = ACTIVE
        """State of the life cycle. Records and timers are served in ``active`` alone."""
        self.on_failure: Callable[[Exception], None] | None = None
        """Takes what a callback raises, in a process shared by several stands; without it the
        program ends."""
        self.streams: dict[type, Subscription] = {}
        self.stand = node.get_namespace().strip("/") or "stand"

    @property
    def name(self) -> str:
        """Node name with its namespace, without the leading slash."""
        return str(self._node.get_fully_qualified_name()).lstrip("/")

    @property
    def working(self) -> bool:
        """Whether records are taken and timers served."""
        return self.state == ACTIVE

    @property
    def speaks(self) -> bool:
        """Whether records may be published; health may in any state."""
        return self.state not in SILENT

    @property
    def replays(self) -> bool:
        """Whether the node diagnoses a recording: that says nothing of the stand as it is now."""
        return getattr(self._declared.value, "source", "live") != "live"

    def topic_name(self, topic: Topic) -> str:
        """Name of a topic as it is given to the node."""
        return topic.name

    def on(self, transition: str, call: Callable[[], None]) -> None:
        """Call at a transition of the life cycle: ``activate`` or ``deactivate``."""
        self._hooks[transition].append(call)

    def own_stamps(self) -> frozenset[int]:
        """Stamps of the latest reports on /diagnostics that this node has published."""
        return frozenset(self._own_stamps)

    def run_hooks(self, transition: str) -> None:
        """Call what has been registered for a transition."""
        for call in self._hooks[transition]:
            call()

    def forget(self) -> None:
        """Forget what the program has registered and made; the node destroys the latter."""
        self._hooks.clear()
        self._declared.on_check.clear()
        self._declared.on_change.clear()
        self.publishers.forget_but(Health)
        self._clock = None
        self._readers.clear()
        self.streams.clear()

    @property
    def ended(self) -> bool:
        """Whether the program has been asked to end, by a signal or by itself."""
        return bool(self._finished.done())

    def end(self, error: FleaError | None = None) -> None:
        """End the program after this callback, with status 0, or 2 and the error as last line."""
        if error is not None and self.on_failure is not None:
            self.on_failure(error)
        elif not self.ended:
            self._finished.set_result(error)

    def soon(self, call: Callable[[], None]) -> None:
        """Call once, after what the executor already has to do."""

        def due() -> None:
            try:
                call()
            except Exception as error:  # raised out of a task it would crash an EventsExecutor
                if not self.ended:
                    self._finished.set_exception(error)

        self._executor.create_task(due)

    def guarded(self, call: Callable[..., Any]) -> Callable[..., Any]:
        """The same call, whose exceptions go to ``on_failure`` where that is set."""

        def kept(*given: Any) -> Any:
            try:
                return call(*given)
            except Exception as error:
                if self.on_failure is None:
                    raise
                self.on_failure(error)
                return None

        return kept

    def full_name(self, record_type: type) -> str:
        """Topic name of a record type, with namespace and remapping applied."""
        return str(self._node.resolve_topic_name(self.topic_name(TOPIC_OF[record_type])))

    def now_ns(self) -> int:
        """Clock of the node (simulated with use_sim_time); for lags only, not for diagnosis."""
        return int(self._node.get_clock().handle.get_now().nanoseconds)  # now() takes four times it

    def check_parameters(self, check: Callable[[P], None]) -> None:
        """Refuse changes for which ``check`` raises ``ConfigurationError``, with its message.

        ``check`` must not have side effects.
        """
        self._declared.on_check.append(check)

    def on_parameters(self, apply: Callable[[P], None]) -> None:
        """Call ``apply`` with all parameters after a change of any of them."""
        self._declared.on_change.append(self.guarded(apply))

    # -- publishing

    def advertise(self, *record_types: type) -> None:
        """Create publishers now, so that subscribers find them before the first record."""
        for record_type in record_types:
            self.publishers.advertise(record_type)

    def publish(self, record: Record) -> None:
        """Publish a record on its topic."""
        if isinstance(record, Health):
            self._own_stamps.append(record.stamp_ns)
        self.publish_raw(type(record), codec.encode(record, self.stand))

    def publish_block(self, block: ResidualBlock) -> None:
        """Publish the residuals of many scans, each by itself; none where nobody listens.

        Their topic keeps nothing for who comes later.
        """
        if self.publishers.matched(Residual):
            for data in codec.encode_block(block):
                self.publish_raw(Residual, data)

    def publish_raw(self, record_type: type, data: bytes) -> None:
        """Publish bytes written by the codec; nothing but health while the node is inactive."""
        if record_type not in self.publishers:
            self.publishers.advertise(record_type)
        if self.state not in SILENT or record_type is Health:
            self.publishers[record_type].publish(data)

    def publish_clock(self, stamp_ns: int) -> None:
        """Publish /clock, for nodes that use simulated time."""
        from rosgraph_msgs.msg import Clock

        if self._clock is None:
            self._clock = self._node.create_publisher(Clock, "/clock", 10)
        message = Clock()
        message.clock.sec, message.clock.nanosec = divmod(stamp_ns, 1_000_000_000)
        self._clock.publish(message)

    # -- subscribing

    def subscribe(self, record_type: type, take: Callable[[Any], None]) -> Subscription:
        """Call ``take`` with each record; invalid messages are counted and skipped."""

        def decoded(data: bytes) -> None:
            take(codec.decode(record_type, data))

        return self.subscribe_raw(record_type, decoded)

    def subscribe_raw(
        self, record_type: type, take: Callable[[bytes], None], depth: int | None = None
    ) -> Subscription:
        """Call ``take`` with the bytes of each message as received.

        ``depth`` is the queue length; by default that of the topic.
        """
        topic = TOPIC_OF[record_type]
        if depth is None:
            depth = READER_DEPTH if topic.latched else topic.depth
        stream = self.streams.setdefault(record_type, Subscription(topic, self))
        if not self._readers:
            self.always(LOOK_S, self._look)
        self._readers[record_type] = Reader(
            self._node,
            codec.message_class(record_type),
            self.topic_name(topic),
            stream,
            take,
            qos.reliable(depth, topic.latched),
            self.caution,
        )
        return stream

    def _look(self) -> None:
        for reader in self._readers.values():
            reader.look()

    def unsubscribe(self, record_type: type) -> None:
        """Take no more records of a type; its counters stay."""
        known = self._readers.pop(record_type, None)
        if known is not None:
            known.destroy()

    def subscribe_foreign(self, topic: str, message: str, take: Callable[[Any], None]) -> None:
        """Call ``take`` with each message of a topic of any installed type, while active."""

        def received(content: Any) -> None:
            if self.working:
                take(content)

        subscribe_foreign(self._node, topic, message, received)

    def advertise_foreign(self, topic: str, message: str) -> Callable[[Mapping[str, Any]], None]:
        """Publish on a topic of any installed type, while active: a function of its fields."""
        publish = advertise_foreign(self._node, topic, message)

        def spoken(values: Mapping[str, Any]) -> None:
            if self.speaks:
                publish(values)

        return spoken

    # -- timers, services

    def every(self, seconds: float, call: Callable[[], None]) -> None:
        """Call at a fixed period of real time, also while simulated time is paused."""

        def due() -> None:
            if not self.working:
                return
            try:
                call()
            except FleaError as error:
                self.end(error)  # an executor would log it as fatal besides

        self.always(seconds, due)

    def always(self, seconds: float, call: Callable[[], None]) -> Any:
        """The same in every state of the life cycle; returns the timer."""
        from rclpy.clock import Clock, ClockType

        clock = Clock(clock_type=ClockType.STEADY_TIME)
        guarded = self.guarded(call)

        def due() -> None:  # from Kilted on rclpy gives more to a callback that takes anything
            guarded()

        return self._node.create_timer(seconds, due, clock=clock)

    def serve_trigger(self, name: str, answer: Callable[[], str]) -> None:
        """Offer a std_srvs/Trigger service; ``answer`` executes it and returns its message."""
        from std_srvs.srv import Trigger

        def respond(_request: Any, response: Any) -> Any:
            told = self.guarded(answer)() if self.working else None
            response.success = told is not None
            response.message = f"the node is {self.state}" if told is None else told
            return response

        self._node.create_service(Trigger, name, respond)

    def remote_parameter(self, node: str, name: str) -> RemoteParameter:
        """A string parameter of another node of this namespace."""
        return RemoteParameter(self._node, self.always, node, name)

    def node_states(self, names: Iterable[str]) -> NodeStates:
        """Life-cycle states of other nodes of this namespace."""
        return NodeStates(self._node, names)

    def remote_service(self, type_name: str, name: str) -> RemoteService:
        """A service of another package; ConfigurationError where its type is not installed."""
        return RemoteService(self._node, type_name, name)

    # -- discovery

    def subscribers(self, record_type: type) -> int:
        """Number of subscriptions to the topic of a record type, in any process."""
        return int(self._node.count_subscribers(TOPIC_OF[record_type].name))

    def writers(self, record_type: type) -> int:
        """Number of publishers of the topic of a record type, in any process."""
        return int(self._node.count_publishers(self.topic_name(TOPIC_OF[record_type])))

    def sources(self, record_type: type) -> tuple[str, ...]:
        """Nodes that publish the topic of a record type, with their namespaces; one a publisher."""
        return sources_of(self._node, self.full_name(record_type))

    def wait_for_subscribers(
        self, *record_types: type, count: int = 1, timeout_s: float = 10.0
    ) -> bool:
        """Spin until each topic has ``count`` subscribers; False on timeout."""
        return self.wait_until(
            lambda: all(self.publishers.matched(kind) >= count for kind in record_types),
            timeout_s,
        )

    def wait_until(self, predicate: Callable[[], bool], timeout_s: float) -> bool:
        """Spin until ``predicate`` is true; False on timeout or shutdown."""
        deadline_ns = time.monotonic_ns() + int(timeout_s * 1e9)
        while not predicate():
            if self.ended or time.monotonic_ns() > deadline_ns:
                return False
            self._executor.spin_once(timeout_sec=POLL_S)
        return True
