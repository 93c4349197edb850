"""Publishers and subscriptions of one node, in records.

Messages travel as the bytes that the codec writes and reads: ``publish(bytes)`` and raw
subscriptions cost one memcpy, where a message object costs up to a millisecond.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from flea_diag.errors import FleaError, InputError, WireError
from flea_diag.wire.bus.declared import Declared
from flea_diag.wire.bus.remote_parameter import RemoteParameter
from flea_diag.wire.messages import codec
from flea_diag.wire.records import Record
from flea_diag.wire.topics import TOPIC_OF, Topic

P = TypeVar("P")

WARN_EVERY_S = 5.0
"""A warning that repeats is logged at most this often; the counters miss none."""

POLL_S = 0.02

READER_DEPTH = 100
"""Samples of a latched topic that may wait for their reader. The writer keeps one for those who
join late, but changes may come in a burst: a reader that keeps one too loses all but the last.
"""


@dataclass
class Subscription:
    """Counters of one subscription: messages that came, and why some were passed over."""

    topic: Topic
    received: int = 0
    malformed: int = 0
    refused: int = 0
    lost: int = 0


class Bus(Generic[P]):
    """Has a node, is not a node: what a program needs of ROS, and nothing else.

    Parameters
    ----------
    node, executor
        Of rclpy; the executor already holds the node.
    declared
        The node's parameters.
    finished
        Future that ends the program when it is done.
    """

    def __init__(self, node: Any, executor: Any, declared: Declared[P], finished: Any) -> None:
        self._node = node
        self._executor = executor
        self._declared = declared
        self._finished = finished
        self._publishers: dict[type, Any] = {}
        self._clock: Any = None
        self.streams: dict[type, Subscription] = {}
        self.stand = node.get_namespace().strip("/") or "stand"

    @property
    def name(self) -> str:
        """Node name with its namespace, without the leading slash."""
        return str(self._node.get_fully_qualified_name()).lstrip("/")

    @property
    def ok(self) -> bool:
        """Whether the node still runs: false once SIGINT or SIGTERM came."""
        return bool(self._node.context.ok())

    def end(self, error: FleaError | None = None) -> None:
        """End the program after this callback: status 0, or 2 with the error as its last line."""
        if not self._finished.done():
            self._finished.set_result(error)

    def full_name(self, record_type: type) -> str:
        """Name of the record's topic with namespace and remapping applied."""
        return str(self._node.resolve_topic_name(TOPIC_OF[record_type].name))

    def now_ns(self) -> int:
        """Clock of the node (simulated if use_sim_time): for lags only, never for inference."""
        return int(self._node.get_clock().now().nanoseconds)

    def check_parameters(self, check: Callable[[P], None]) -> None:
        """Refuse a change, with its message as the reason, where ``check`` raises.

        ``check`` raises ``ConfigurationError`` and changes nothing.
        """
        self._declared.on_check.append(check)

    def on_parameters(self, apply: Callable[[P], None]) -> None:
        """Call ``apply`` with all parameters whenever one of them was changed."""
        self._declared.on_change.append(apply)

    # -- out

    def advertise(self, *record_types: type) -> None:
        """Create publishers now, so that subscribers find them before the first record."""
        for record_type in record_types:
            if record_type not in self._publishers:
                self._publishers[record_type] = self._create_publisher(record_type)

    def publish(self, record: Record) -> None:
        """Publish a record on its topic; does nothing once the node is being shut down."""
        self.publish_raw(type(record), codec.encode(record, self.stand))

    def publish_raw(self, record_type: type, data: bytes) -> None:
        """Publish bytes that the codec wrote."""
        self.advertise(record_type)
        if self.ok:
            self._publishers[record_type].publish(data)

    def publish_clock(self, stamp_ns: int) -> None:
        """Be the clock of a graph whose nodes use simulated time: publish /clock."""
        from rosgraph_msgs.msg import Clock

        if self._clock is None:
            self._clock = self._node.create_publisher(Clock, "/clock", 10)
        message = Clock()
        message.clock.sec, message.clock.nanosec = divmod(stamp_ns, 1_000_000_000)
        if self.ok:
            self._clock.publish(message)

    def _create_publisher(self, record_type: type) -> Any:
        topic = TOPIC_OF[record_type]
        return self._node.create_publisher(
            codec.message_class(record_type),
            topic.name,
            _qos(topic, topic.depth),
            qos_overriding_options=_overriding(),
        )

    # -- in

    def subscribe(self, record_type: type, take: Callable[[Any], None]) -> Subscription:
        """Call ``take`` with each record; what cannot be used is counted and passed over."""

        def decoded(data: bytes) -> None:
            take(codec.decode(record_type, data))

        return self.subscribe_raw(record_type, decoded)

    def subscribe_raw(
        self, record_type: type, take: Callable[[bytes], None], depth: int | None = None
    ) -> Subscription:
        """Call ``take`` with the bytes of each message as they came in.

        ``depth`` messages may wait for it; that of the topic where it is not told.
        """
        from rclpy.event_handler import SubscriptionEventCallbacks

        topic = TOPIC_OF[record_type]
        if depth is None:
            depth = READER_DEPTH if topic.latched else topic.depth
        stream = self.streams.setdefault(record_type, Subscription(topic))

        def received(data: bytes) -> None:
            stream.received += 1
            try:
                take(data)
            except WireError as error:
                stream.malformed += 1
                self.warn(f"{topic.name}: message passed over: {error}")
            except InputError as error:
                stream.refused += 1
                self.warn(f"{topic.name}: record passed over: {error}")

        def lost(event: Any) -> None:
            stream.lost += event.total_count_change
            self.warn(
                f"{topic.name}: {event.total_count} messages lost: reader or network too slow"
            )

        self._node.create_subscription(
            codec.message_class(record_type),
            topic.name,
            received,
            _qos(topic, depth),
            event_callbacks=SubscriptionEventCallbacks(message_lost=lost),
            qos_overriding_options=_overriding(),
            raw=True,
        )
        return stream

    # -- time, services, words

    def every(self, seconds: float, call: Callable[[], None]) -> None:
        """Call at a steady period, also while simulated time stands still."""
        self._timer(seconds, call)

    def _timer(self, seconds: float, call: Callable[[], None]) -> Any:
        from rclpy.clock import Clock, ClockType

        clock = Clock(clock_type=ClockType.STEADY_TIME)
        return self._node.create_timer(seconds, call, clock=clock)

    def serve_trigger(self, name: str, answer: Callable[[], str]) -> None:
        """Offer a std_srvs/Trigger; ``answer`` does it and says in words what was done."""
        from std_srvs.srv import Trigger

        def respond(_request: Any, response: Any) -> Any:
            response.success, response.message = True, answer()
            return response

        self._node.create_service(Trigger, name, respond)

    def remote_parameter(self, node: str, name: str) -> RemoteParameter:
        """A parameter of text of another node of this namespace."""
        return RemoteParameter(self._node, self._timer, node, name)

    def info(self, text: str) -> None:
        """Log a line."""
        self._node.get_logger().info(text)

    def warn(self, text: str) -> None:
        """Log a warning, throttled."""
        # The throttle of rclpy belongs to this line of code, not to the text: one a node.
        self._node.get_logger().warning(text, throttle_duration_sec=WARN_EVERY_S)

    # -- discovery

    def subscribers(self, record_type: type) -> int:
        """How many subscriptions this node knows on the record's topic, in any process."""
        return int(self._node.count_subscribers(TOPIC_OF[record_type].name))

    def publishers(self, record_type: type) -> int:
        """How many publishers this node knows on the record's topic, in any process."""
        return int(self._node.count_publishers(TOPIC_OF[record_type].name))

    def wait_for_subscribers(
        self, *record_types: type, count: int = 1, timeout_s: float = 10.0
    ) -> bool:
        """Serve the node until each topic has ``count`` subscribers; False when time ran out."""
        return self.wait_until(
            lambda: all(self._matched(record_type) >= count for record_type in record_types),
            timeout_s,
        )

    def wait_until(self, predicate: Callable[[], bool], timeout_s: float) -> bool:
        """Serve the node until ``predicate`` holds; False when time ran out or it shuts down."""
        deadline_ns = time.monotonic_ns() + int(timeout_s * 1e9)
        while not predicate():
            if not self.ok or time.monotonic_ns() > deadline_ns:
                return False
            self._executor.spin_once(timeout_sec=POLL_S)
        return True

    def _matched(self, record_type: type) -> int:
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
