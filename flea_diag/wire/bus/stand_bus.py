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

"""The topics of a stand in another namespace, from the node of a screen."""

from __future__ import annotations

from typing import Any, TypeVar

from flea_diag.wire.bus.endpoint import Bus
from flea_diag.wire.bus.remote.remote_parameter import RemoteParameter
from flea_diag.wire.topics import TOPIC_OF, Topic

P = TypeVar("P")


class StandBus(Bus[P]):
    """A bus on the node of another, with topic names below a namespace.

    Parameters
    ----------
    host
        Bus of the node; its life cycle holds for both.
    namespace
        Of the stand, relative to that of the node.
    """

    def __init__(self, host: Bus[P], namespace: str) -> None:
        super().__init__(host._node, host._executor, host._declared, host._finished)
        self._host, self._namespace = host, namespace
        own = host._node.get_namespace().strip("/")
        self.stand = f"{own}/{namespace}".strip("/")

    @property
    def working(self) -> bool:
        """Whether records are taken and timers served."""
        return self._host.working

    @property
    def speaks(self) -> bool:
        """Whether records may be published."""
        return self._host.speaks

    def topic_name(self, topic: Topic) -> str:
        """Name of a topic below the namespace of the stand."""
        return topic.name if topic.name.startswith("/") else f"{self._namespace}/{topic.name}"

    def remote_parameter(self, node: str, name: str) -> RemoteParameter:
        """A string parameter of another node of the stand."""
        return super().remote_parameter(f"{self._namespace}/{node}", name)


def namespaces(bus: Bus[Any], record_type: type) -> set[str]:
    """Namespaces below that of a node in which anybody publishes or reads a record's topic."""
    own = bus._node.get_namespace().rstrip("/") + "/"
    ending = "/" + TOPIC_OF[record_type].name
    return {
        name[len(own) : -len(ending)]
        for name, _ in bus._node.get_topic_names_and_types()
        if name.startswith(own) and name.endswith(ending) and len(name) > len(own) + len(ending)
    }
