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

"""What the node tests share: processes that are started and ended, and a peer on the bus."""

from __future__ import annotations

import os
import selectors
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from flea_diag.nodes.run.children import end_with_parent
from flea_diag.nodes.run.live_run import discovery
from flea_diag.wire.topics import TOPIC_OF
from support.places import ROOT

LIMIT_S = 180.0
"""No wait takes this long unless something is broken: so long a live run waits for its nodes on a
machine with much else to do."""


def environment(domain: int, **more: str) -> dict[str, str]:
    """Environment of a process in a domain of its own, on this machine only.

    As ``scripts/run`` has it: many a test kills a node, which may spoil shared memory for the rest.
    """
    return {
        **os.environ,
        **discovery(),
        "ROS_DOMAIN_ID": str(domain),
        "PYTHONPATH": str(ROOT),
        "PYTHONUNBUFFERED": "1",
        **more,
    }


class Process:
    """A child whose output can be waited for; it is killed at the end of the ``with``."""

    def __init__(self, command: Sequence[str], domain: int, **more: Any) -> None:
        cwd = more.pop("cwd", ROOT)
        self.child = subprocess.Popen(
            command,
            env=environment(domain, **more),
            cwd=cwd,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            stdin=subprocess.DEVNULL,
            # Whoever kills the tests leaves no node behind, in a domain that then looks free.
            preexec_fn=end_with_parent,
        )
        self.output = ""
        assert self.child.stdout is not None
        self._pipe = self.child.stdout
        os.set_blocking(self._pipe.fileno(), False)

    def __enter__(self) -> Process:
        return self

    def __exit__(self, *_: object) -> None:
        if self.child.poll() is None:
            self.child.kill()
        self.child.wait()
        self._pipe.close()

    def wait_for(self, text: str, limit_s: float = LIMIT_S) -> str:
        """Output so far, once it holds ``text``."""
        deadline = time.monotonic() + limit_s
        with selectors.DefaultSelector() as selector:
            selector.register(self._pipe, selectors.EVENT_READ)
            while text not in self.output:
                left = deadline - time.monotonic()
                assert left > 0, f"no {text!r} within {limit_s} s in:\n{self.output}"
                if selector.select(left):
                    chunk = self._pipe.read()
                    assert chunk, f"ended without {text!r}:\n{self.output}"
                    self.output += chunk.decode()
        return self.output

    def read(self) -> None:
        """Take what there is of its output, without waiting."""
        self.output += (self._pipe.read() or b"").decode()

    def signal(self, *numbers: signal.Signals) -> int:
        """Send signals and wait for the end; the exit status."""
        for number in numbers:
            self.child.send_signal(number)
        return self.end()

    def end(self) -> int:
        """Wait for the end; the exit status."""
        status = self.child.wait(LIMIT_S)
        os.set_blocking(self._pipe.fileno(), True)
        self.output += self._pipe.read().decode()
        return status


def children(pid: int) -> list[int]:
    """Process ids of the children of a process."""
    listed = Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="ascii").split()
    return [int(child) for child in listed]


def process_of(parent: int, name: str) -> int:
    """Process id of the one child that is this executable."""
    (found,) = (
        pid
        for pid in children(parent)
        if name in Path(f"/proc/{pid}/cmdline").read_bytes().decode().split("\0")
    )
    return found


def node(name: str, *arguments: str) -> list[str]:
    """Command line of one of our nodes, from the source tree."""
    ros = ["--ros-args", *arguments] if arguments else []
    return [sys.executable, "-m", "flea_diag.nodes.main", name, *ros]


def toy(*arguments: str) -> list[str]:
    """Command line of the toy stage's node."""
    ros = ["--ros-args", *arguments] if arguments else []
    return [sys.executable, str(ROOT / "test" / "support" / "programs" / "toy_node.py"), *ros]


class Peer:
    """A guest on the bus that publishes, and keeps every record that it was sent."""

    def __init__(self, domain: int, namespace: str = "", name: str = "peer") -> None:
        from flea_diag.wire.bus import guest

        os.environ.update(discovery())
        self._guest = guest(name, domain, namespace)
        self.records: list[Any] = []

    def __enter__(self) -> Peer:
        self.bus = self._guest.__enter__()
        self.node = self.bus._node
        return self

    def __exit__(self, *_: object) -> None:
        self._guest.__exit__(None, None, None)

    def listen(self, *record_types: type) -> None:
        """Keep records of these types, and wait until somebody publishes them."""
        for record_type in record_types:
            self.bus.subscribe(record_type, self.records.append)
        topics = [TOPIC_OF[record_type].name for record_type in record_types]
        self.until(lambda: all(map(self.node.count_publishers, topics)))

    def heard(self, *record_types: type, count: int = 1) -> bool:
        """Wait until each topic has so many subscribers; false if it has not within the limit."""
        wait = self.bus.wait_for_subscribers
        return bool(wait(*record_types, count=count, timeout_s=LIMIT_S))

    def find(self, predicate: Callable[[Any], bool], limit_s: float = LIMIT_S) -> Any:
        """First record, also of those to come, for which ``predicate`` holds."""
        self.until(lambda: any(map(predicate, self.records)), limit_s)
        return next(filter(predicate, self.records))

    def until(self, predicate: Callable[[], bool], limit_s: float = LIMIT_S) -> None:
        """Serve the node until ``predicate`` holds."""
        assert self.bus.wait_until(predicate, limit_s), (
            f"not within {limit_s} s: {self.records[-3:]}"
        )

    def acknowledged(self, record_type: type) -> bool:
        """Wait until every reader has what was published; what it does with it is another thing."""
        from rclpy.duration import Duration

        return bool(
            self.bus.publishers[record_type].wait_for_all_acked(Duration(seconds=int(LIMIT_S)))
        )

    def change_state(self, node: str, transition: str) -> bool:
        """Ask a node for a transition of its life cycle; whether it succeeded."""
        from lifecycle_msgs.msg import Transition
        from lifecycle_msgs.srv import ChangeState

        request = ChangeState.Request(transition=Transition(label=transition))
        return bool(self.call(ChangeState, f"{node}/change_state", request).success)

    def state(self, node: str) -> str:
        """State of a node's life cycle, asked for by its service."""
        from lifecycle_msgs.srv import GetState

        answer = self.call(GetState, f"{node}/get_state", GetState.Request())
        return str(answer.current_state.label)

    def call(self, service_type: type, name: str, request: Any) -> Any:
        """Answer of a service."""
        client = self.node.create_client(service_type, name)
        self.until(client.service_is_ready)
        future = client.call_async(request)
        self.until(future.done)
        return future.result()
