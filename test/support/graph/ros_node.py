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

"""What ``flea_diag.wire.bus`` asks of a node and an executor of rclpy, on a simulated network."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

from support.graph.network import Network, Reader, Writer

LEVELS = ("debug", "info", "warning", "error", "fatal")
TRANSITIONS = {
    ("unconfigured", "configure"): "configuring",
    ("configuring", "transition_success"): "inactive",
    ("configuring", "transition_failure"): "unconfigured",
    ("inactive", "activate"): "activating",
    ("activating", "transition_success"): "active",
    ("activating", "transition_failure"): "inactive",
    ("active", "deactivate"): "deactivating",
    ("deactivating", "transition_success"): "inactive",
    ("deactivating", "transition_failure"): "active",
    ("inactive", "cleanup"): "cleaningup",
    ("cleaningup", "transition_success"): "unconfigured",
    ("cleaningup", "transition_failure"): "inactive",
}
"""Of the design article "Managed nodes"."""


class States:
    """State machine of a managed node, as rcl has it."""

    def __init__(self) -> None:
        self.current_state = (1, "unconfigured")

    def trigger_transition_by_label(self, label: str, _publish: bool) -> None:
        """Go on to the next state."""
        self.current_state = (1, TRANSITIONS[self.current_state[1], label])


class Timer:
    """Fires at its period until it is cancelled; late once for all that it has missed."""

    def __init__(self, node: RosNode, seconds: float, call: Callable[[], None]) -> None:
        self._node, self._seconds, self._call = node, seconds, call
        self.cancelled = self._waits = False
        self._arm()

    def _arm(self) -> None:
        self._node.network.scheduler.after(self._seconds, self._due)

    def _due(self) -> None:
        if self.cancelled:
            return
        self._arm()
        if not self._waits:
            self._waits = True
            self._node.serve_soon(self._served)

    def _served(self) -> None:
        self._waits = False
        if not self.cancelled:
            self._call()


class RosNode:
    """A node of rclpy, and the executor that serves it alone.

    Parameters
    ----------
    network : carries its messages
    name, namespace : of the node
    values : parameters that are given to it
    cost_ns : draws how long a callback keeps the node busy
    """

    def __init__(
        self,
        network: Network,
        name: str,
        namespace: str = "/",
        values: dict[str, Any] | None = None,
        cost_ns: Callable[[], int] = lambda: 0,
    ) -> None:
        self.network, self._name, self._namespace = network, name, namespace
        self._values, self._cost_ns = dict(values or {}), cost_ns
        self.publishers: list[Writer] = []
        self.subscriptions: list[Reader] = []
        self.timers: list[Timer] = []
        self.services: list[Any] = []
        self.clients: list[Any] = []
        self.triggers: dict[str, Any] = {}
        self.said: list[tuple[str, str]] = []
        """Lines of its log, with their levels."""
        self.raised: BaseException | None = None
        """What came out of a callback: it has ended the process."""
        self.after_each: Callable[[], None] = lambda: None
        """Called after each callback."""
        self.busy_until_ns = 0
        self._ready: deque[Callable[[], None]] = deque()
        self._serving = False
        self._state_machine = States()
        self._service_change_state = SimpleNamespace(callback=None)
        network.nodes.append(self)

    # -- executor

    def serve_soon(self, call: Callable[[], None]) -> None:
        """Serve after what is ready already."""
        self._ready.append(call)
        self._go_on()

    create_task = serve_soon

    def _go_on(self) -> None:
        if self._ready and not self._serving:
            self._serving = True
            self.network.scheduler.at(self.busy_until_ns, self._serve)

    def _serve(self) -> None:
        self._serving = False
        if self.raised is not None or not self._ready:
            return
        try:
            self._ready.popleft()()
        except KeyboardInterrupt:  # meant for the simulation
            raise
        except BaseException as error:  # of an executor it would end the process
            self.raised = error
            return
        now_ns = self.network.scheduler.now_ns
        self.busy_until_ns = max(self.busy_until_ns, now_ns + self._cost_ns())
        self.after_each()
        self._go_on()

    def kill(self) -> None:
        """The process dies: what it had is gone."""
        self._ready.clear()
        for timer in self.timers:
            timer.cancelled = True
        for reader in tuple(self.subscriptions):
            self.destroy_subscription(reader)
        for writer in tuple(self.publishers):
            self.destroy_publisher(writer)
        self.network.nodes.remove(self)

    # -- entities

    def create_publisher(self, _kind: Any, topic: str, qos: Any, **_more: Any) -> Writer:
        """As rclpy."""
        made = Writer(self.network, self, self.resolve_topic_name(topic), qos)
        self.publishers.append(made)
        return self.network.add_writer(made)

    def create_subscription(
        self, _kind: Any, topic: str, callback: Callable[..., None], qos: Any, **_more: Any
    ) -> Reader:
        """As rclpy; a callback of decoded messages is given none, for nobody here sends them."""
        waiting: deque[Any] = deque(maxlen=qos.depth)
        made = Reader(self, self.resolve_topic_name(topic), callback, qos, waiting)
        self.subscriptions.append(made)
        return self.network.add_reader(made)

    def create_timer(self, seconds: float, call: Callable[[], None], clock: Any = None) -> Timer:
        """As rclpy."""
        made = Timer(self, seconds, call)
        self.timers.append(made)
        return made

    def create_service(self, _kind: Any, name: str, answer: Any) -> Any:
        """As rclpy."""
        self.triggers[name] = answer
        self.services.append(answer)
        return answer

    def destroy_publisher(self, writer: Writer) -> None:
        """As rclpy."""
        self.publishers.remove(writer)
        self.network.remove_writer(writer)

    def destroy_subscription(self, reader: Reader) -> None:
        """As rclpy."""
        self.subscriptions.remove(reader)
        self.network.remove_reader(reader)

    def destroy_timer(self, timer: Timer) -> None:
        """As rclpy."""
        timer.cancelled = True
        self.timers.remove(timer)

    def destroy_service(self, service: Any) -> None:
        """As rclpy."""
        self.services.remove(service)

    # -- names, clock, log

    def get_name(self) -> str:
        """As rclpy."""
        return self._name

    def get_namespace(self) -> str:
        """As rclpy."""
        return self._namespace

    def get_fully_qualified_name(self) -> str:
        """As rclpy."""
        return f"{self._namespace.rstrip('/')}/{self._name}"

    def resolve_topic_name(self, name: str) -> str:
        """As rclpy."""
        if name.startswith("/"):
            return name
        if name.startswith("~/"):
            return f"{self.get_fully_qualified_name()}/{name[2:]}"
        return f"{self._namespace.rstrip('/')}/{name}"

    def get_clock(self) -> Any:
        """As rclpy."""
        moment = SimpleNamespace(nanoseconds=self.network.scheduler.wall_ns)
        return SimpleNamespace(
            handle=SimpleNamespace(get_now=lambda: moment),
            now=lambda: moment,
            ros_time_is_active=False,
        )

    def get_logger(self) -> Any:
        """As rclpy."""
        return SimpleNamespace(
            **{level: lambda text, level=level: self.said.append((level, text)) for level in LEVELS}
        )

    # -- graph

    def count_publishers(self, topic: str) -> int:
        """As rclpy."""
        return len(self.get_publishers_info_by_topic(self.resolve_topic_name(topic)))

    def count_subscribers(self, topic: str) -> int:
        """As rclpy."""
        return len(self.get_subscriptions_info_by_topic(self.resolve_topic_name(topic)))

    def get_publishers_info_by_topic(self, topic: str) -> list[Any]:
        """As rclpy."""
        return [_info(each) for each in self.network.writers if each.topic == topic]

    def get_subscriptions_info_by_topic(self, topic: str) -> list[Any]:
        """As rclpy."""
        return [_info(each) for each in self.network.readers if each.topic == topic]

    def get_node_names_and_namespaces(self) -> list[tuple[str, str]]:
        """As rclpy."""
        return [(each.get_name(), each.get_namespace()) for each in self.network.nodes]

    # -- parameters

    def get_parameters_by_prefix(self, _prefix: str) -> dict[str, Any]:
        """As rclpy."""
        return {name: SimpleNamespace(value=value) for name, value in self._values.items()}

    def undeclare_parameter(self, name: str) -> None:
        """As rclpy."""
        del self._values[name]

    def declare_parameter(self, *_given: Any, **_more: Any) -> None:
        """As rclpy; nobody asks for the value."""

    def add_on_set_parameters_callback(self, _call: Any) -> None:
        """As rclpy; nobody sets one."""

    def add_post_set_parameters_callback(self, _call: Any) -> None:
        """As rclpy; nobody sets one."""


def _info(end: Writer | Reader) -> Any:
    """An endpoint as the graph tells of it."""
    node = end.node
    return SimpleNamespace(
        node_name=node.get_name(), node_namespace=node.get_namespace(), qos_profile=end.qos_profile
    )
