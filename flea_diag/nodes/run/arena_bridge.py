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

"""A ROS 2 node as an entrant of the arena: ``python -m flea_diag.nodes.run.arena_bridge COMMAND``.

Lines of JSON on one side (``tools/arena``), topics on the other: scans go out on ``sensors/slow``
at some times real time, in a domain of their own, and what the node says on ``ambiguity_group``
is the answer to the scan that has just been sent.
"""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Any

from flea_diag.errors import FleaError
from flea_diag.nodes.run.domain import reserved_domain
from flea_diag.nodes.run.live_run import discovery
from flea_diag.wire.bus import Bus, guest
from flea_diag.wire.json_text import parse_json
from flea_diag.wire.records import AmbiguityGroup, ChannelInfo, ChannelTable, Outcome, Scan

SPEED = 4.0
"""Times real time."""
START_NS = 1_000_000_000_000_000_000
PATIENCE_S = 60.0
"""How long the node is waited for at its start."""
QUIET_S = 1.0
"""Time after the last scan for a last answer."""
ANY = math.inf


class ArenaBridge:
    """Hands scans to a node, and what it says back.

    Parameters
    ----------
    bus
        Bus of the domain in which the node runs.
    process
        The node.
    """

    def __init__(self, bus: Bus[Any], process: subprocess.Popen[bytes]) -> None:
        self._bus, self._process = bus, process
        self._group: AmbiguityGroup | None = None
        self._began_s = 0.0
        bus.advertise(ChannelTable, Scan)
        bus.subscribe(AmbiguityGroup, self._take)

    def answer(self, message: dict[str, Any]) -> dict[str, Any]:
        """The reply to one line."""
        if message["kind"] == "start":
            return self._start(message["stand"])
        if message["kind"] == "scan":
            return self._scan(message["time_s"], message["values"])
        self._bus.wait_until(self._ended, QUIET_S)
        return self._faults()

    def _start(self, stand: dict[str, Any]) -> dict[str, Any]:
        """Wait until the node reads scans, and tell it of the channels."""
        found = self._bus.wait_until(
            lambda: self._ended() or self._bus.subscribers(Scan) > 0, PATIENCE_S
        )
        if not found or self._ended():
            return {"failed": f"no subscription to sensors/slow within {PATIENCE_S:g} s"}
        self._bus.wait_for_subscribers(Scan)
        rate_hz = 1.0 / stand["period_s"]
        rows = (ChannelInfo(n, u, -ANY, ANY, rate_hz) for n, u in stand["channels"].items())
        self._bus.publish(ChannelTable(START_NS, stand["name"], tuple(rows)))
        return {}

    def _scan(self, time_s: float, values: dict[str, float | None]) -> dict[str, Any]:
        """Publish a scan when it is due, and serve the answers until then."""
        if not self._began_s:
            self._began_s = time.monotonic() - time_s / SPEED
        left_s = self._began_s + time_s / SPEED - time.monotonic()
        self._bus.wait_until(self._ended, max(left_s, 0.0))
        if self._ended():
            return {"failed": f"the node ended with status {self._process.returncode}"}
        row = tuple(math.nan if value is None else value for value in values.values())
        self._bus.publish(Scan(START_NS + round(time_s * 1e9), tuple(values), row))
        return self._faults()

    def _ended(self) -> bool:
        return self._process.poll() is not None

    def _take(self, group: AmbiguityGroup) -> None:
        if not group.stale:
            self._group = group

    def _faults(self) -> dict[str, Any]:
        """The latest group as weights; nothing where the node has said nothing yet."""
        if self._group is None:
            return {}
        if self._group.outcome is Outcome.UNEXPLAINED:
            return {"faults": {"unknown": 1.0}}
        chances = {member.fault: member.probability for member in self._group.members}
        if not any(math.isfinite(chance) and chance > 0.0 for chance in chances.values()):
            return {"faults": dict.fromkeys(chances, 1.0)}
        return {"faults": {f: c if math.isfinite(c) else 0.0 for f, c in chances.items()}}


@contextmanager
def started(command: Sequence[str], domain: int) -> Iterator[subprocess.Popen[bytes]]:
    """The node in its domain, on this machine only; ended at the end."""
    environment = {**os.environ, **discovery(), "ROS_DOMAIN_ID": str(domain)}
    process = subprocess.Popen(
        command, env=environment, stdout=sys.stderr, stdin=subprocess.DEVNULL
    )
    try:
        yield process
    finally:
        with suppress(ProcessLookupError):
            process.send_signal(signal.SIGINT)
        try:
            process.wait(QUIET_S)
        except subprocess.TimeoutExpired:
            process.kill()


def main(argv: Sequence[str] | None = None) -> int:
    """Answer lines until the input ends."""
    command = list(sys.argv[1:] if argv is None else argv)
    os.environ.update(discovery())
    replies = os.fdopen(os.dup(1), "w", encoding="utf-8", buffering=1)
    os.dup2(2, 1)
    try:
        with (
            reserved_domain() as domain,
            started(command, domain) as process,
            guest("arena_bridge", domain) as bus,
        ):
            bridge = ArenaBridge(bus, process)
            for line in sys.stdin:
                replies.write(json.dumps(bridge.answer(parse_json(line))) + "\n")
    except (FleaError, OSError) as error:
        replies.write(json.dumps({"failed": str(error)}) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
