"""Publishers and subscriptions of one node, in terms of records.

Messages are passed to rclpy as the bytes of the codec: ``publish(bytes)`` and raw subscriptions
cost one memcpy, whereas a message object costs up to 1 ms.
"""

from __future__ import annotations

import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

from flea_diag.errors import FleaError, InputError, WireError
from flea_diag.wire.bus.declared import Declared
from flea_diag.wire.bus.foreign_topic import subscribe_foreign
from flea_diag.wire.bus.life_cycle import ACTIVE, INACTIVE, UNCONFIGURED
from flea_diag.wire.bus.lost_messages import LostMessages, numbered
from flea_diag.wire.bus.node_log import NodeLog
from flea_diag.wire.bus.node_states import NodeStates
from flea_diag.wire.bus.remote_parameter import RemoteParameter
from flea_diag.wire.bus.remote_service import RemoteService
from flea_diag.wire.messages import codec
from flea_diag.wire.records import Health, Record
from flea_diag.wire.topics import TOPIC_OF, Topic

P = TypeVar("P")

POLL_S = 0.02

SILENT = (UNCONFIGURED, INACTIVE)
"""States in which a node publishes nothing but its health."""

READER_DEPTH = 100
"""Queue length of a reader of a latched topic. The writer keeps one sample for late joiners, but
changes may arrive in a burst, of which a reader with one slot would lose all but the last."""


@dataclass
class Subscription:
    """Counters of one subscription: messages received, and messages skipped by reason.

    ``kinds`` counts the malformed ones by the kind of their error, ``malformed_ns`` is the time of
    the first.
    """

    topic: Topic
    received: int = 0
    malformed: int = 0
    malformed_ns: int = 0
    kinds: Counter[str] = field(default_factory=Counter)
    refused: int = 0
    lost: int = 0


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
        self._publishers: dict[type, Any] = {}
        self._subscriptions: dict[type, Any] = {}
        self._clock: Any = None
        self._hooks: defaultdict[str, list[Callable[[], None]]] = defaultdict(list)
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

    def topic_name(self, topic: Topic) -> str:
        """Name of a topic as it is given to the node."""
        return topic.name

    def on(self, transition: str, call: Callable[[], None]) -> None:
        """Call at a transition of the life cycle: ``activate`` or ``deactivate``."""
        self._hooks[transition].append(call)

    def run_hooks(self, transition: str) -> None:
        """Call what has been registered for a transition."""
        for call in self._hooks[transition]:
            call()

    def forget(self) -> None:
        """Forget what the program has registered and made; the node destroys the latter."""
        self._hooks.clear()
        self._declared.on_check.clear()
        self._declared.on_change.clear()
        self._publishers = {kind: p for kind, p in self._publishers.items() if kind is Health}
        self._clock = None
        self._subscriptions.clear()
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
            if record_type not in self._publishers:
                self._publishers[record_type] = self._create_publisher(record_type)

    def publish(self, record: Record) -> None:
        """Publish a record on its topic."""
        self.publish_raw(type(record), codec.encode(record, self.stand))

    def publish_raw(self, record_type: type, data: bytes) -> None:
        """Publish bytes written by the codec; nothing but health while the node is inactive."""
        if record_type not in self._publishers:
            self.advertise(record_type)
        if self.state not in SILENT or record_type is Health:
            self._publishers[record_type].publish(data)

    def publish_clock(self, stamp_ns: int) -> None:
        """Publish /clock, for nodes that use simulated time."""
        from rosgraph_msgs.msg import Clock

        if self._clock is None:
            self._clock = self._node.create_publisher(Clock, "/clock", 10)
        message = Clock()
        message.clock.sec, message.clock.nanosec = divmod(stamp_ns, 1_000_000_000)
        self._clock.publish(message)

    def _create_publisher(self, record_type: type) -> Any:
        topic = TOPIC_OF[record_type]
        return self._node.create_publisher(
            codec.message_class(record_type),
            self.topic_name(topic),
            _qos(topic, topic.depth),
            qos_overriding_options=_overriding(),
        )

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
        stream = self.streams.setdefault(record_type, Subscription(topic))

        missing = LostMessages(lambda: int(made.get_publisher_count()))

        def received(data: bytes, number: int | None) -> None:
            # A hundred times a second: every further call is paid for with cold caches.
            try:
                lost = missing.before(number)
                if self.state != ACTIVE:
                    return
                if lost:
                    self._lost(stream, lost)
                stream.received += 1
                take(data)
            except (WireError, InputError) as error:
                self._skipped(stream, error)
            except Exception as error:
                if self.on_failure is None:
                    raise
                self.on_failure(error)

        made = self._node.create_subscription(
            codec.message_class(record_type),
            self.topic_name(topic),
            numbered(received),
            _qos(topic, depth),
            qos_overriding_options=_overriding(),
            raw=True,
        )
        self._subscriptions[record_type] = made
        return stream

    def unsubscribe(self, record_type: type) -> None:
        """Take no more records of a type; its counters stay."""
        known = self._subscriptions.pop(record_type, None)
        if known is not None:
            self._node.destroy_subscription(known)

    @contextmanager
    def counted(self, stream: Subscription) -> Iterator[None]:
        """Count and pass over a message that is malformed, or whose record is refused."""
        try:
            yield
        except (WireError, InputError) as error:
            self._skipped(stream, error)

    def _skipped(self, stream: Subscription, error: WireError | InputError) -> None:
        if isinstance(error, WireError):
            stream.malformed += 1
            stream.kinds[error.kind] += 1
            stream.malformed_ns = stream.malformed_ns or self.now_ns()
            self.warn(f"{stream.topic.name}: message skipped: {error}")
        else:
            stream.refused += 1
            self.warn(f"{stream.topic.name}: record skipped: {error}")

    def _lost(self, stream: Subscription, lost: int) -> None:
        stream.lost += lost
        self.warn(
            f"{stream.topic.name}: {stream.lost} messages lost: subscriber or network too slow"
        )

    def subscribe_foreign(self, topic: str, message: str, take: Callable[[Any], None]) -> None:
        """Call ``take`` with each message of a topic of any installed type, while active."""

        def received(content: Any) -> None:
            if self.working:
                take(content)

        subscribe_foreign(self._node, topic, message, received)

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
        return self._node.create_timer(seconds, self.guarded(call), clock=clock)

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

    def listeners(self, record_type: type) -> set[str]:
        """Names of the nodes of this namespace that have subscribed to the record's topic."""
        found = self._node.get_subscriptions_info_by_topic(self.full_name(record_type))
        here = self._node.get_namespace()
        return {str(info.node_name) for info in found if info.node_namespace == here}

    def connected(self, record_type: type) -> bool:
        """Whether every subscription found in the graph is connected to this node's publisher.

        Not counted are those that ask for more than is offered: they never will be.
        """
        from rclpy.qos import QoSCompatibility, qos_check_compatible

        matched = self.matched(record_type)
        offered = self._publishers[record_type].qos_profile
        found = self._node.get_subscriptions_info_by_topic(self.full_name(record_type))
        possible = sum(
            qos_check_compatible(offered, info.qos_profile)[0] != QoSCompatibility.ERROR
            for info in found
        )
        return bool(matched >= possible)

    def acknowledged(self, record_type: type) -> bool:
        """Whether every connected reader has what was published; each of them knows this writer.

        A writer may find a reader before the reader finds the writer, and what is published in
        between is lost.
        """
        from rclpy.duration import Duration

        return bool(self._publishers[record_type].wait_for_all_acked(Duration(nanoseconds=0)))

    def wait_for_subscribers(
        self, *record_types: type, count: int = 1, timeout_s: float = 10.0
    ) -> bool:
        """Spin until each topic has ``count`` subscribers; False on timeout."""
        return self.wait_until(
            lambda: all(self.matched(record_type) >= count for record_type in record_types),
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

    def matched(self, record_type: type) -> int:
        """Number of subscriptions connected to this node's publisher."""
        self.advertise(record_type)
        return int(self._publishers[record_type].get_subscription_count())


def _qos(topic: Topic, depth: int) -> Any:
    from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if topic.latched else DurabilityPolicy.VOLATILE,
    )


def _overriding() -> Any:
    from rclpy.qos_overriding_options import QoSOverridingOptions

    return QoSOverridingOptions.with_default_policies()
