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

"""What must hold of every simulated graph, whatever has gone wrong in it."""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from mcap.exceptions import McapError
from mcap.reader import make_reader

from flea_diag.errors import FleaError, line_of
from flea_diag.wire.messages.codec import decode
from flea_diag.wire.records import AmbiguityGroup, Outcome, Residual
from support.graph.scheduler import S
from support.graph.world import World, drawn

UNJUDGED_NS = 12 * S
"""Ten seconds that a verdict looks back, one in which the ledger still counts, one for the wire."""
LOST_NS = S
"""What a recorder may lose when it is killed, or its disk is full."""
FRICTION = "parity_mechanical"
CALLED = (Outcome.ISOLATED, Outcome.INDISTINGUISHABLE, Outcome.UNEXPLAINED, Outcome.MODEL_MISMATCH)


@dataclass(frozen=True)
class Judged:
    """What became of one graph; ``wrong`` is empty where all is as it must be."""

    seed: int
    words: str
    graph_s: float
    digest: str
    wrong: tuple[str, ...]
    called: tuple[str, ...]
    """Outcomes with members that were said while a fault was there, or was not."""
    found: bool
    """Whether the fault that there is was called by its name, alone or in a group."""


def flown(seed: int, folder: Path) -> Judged:
    """Simulate the graph of a seed in a folder of its own."""
    folder.mkdir(parents=True)
    world = drawn(seed, folder)
    begun_ns = world.scheduler.now_ns
    with world.scheduler.as_time(), world.disk.in_use():
        world.start()
        world.finish()
    verdicts = list(_verdicts(world))
    wrong = (
        *_ended_badly(world),
        *_wrong_names(world, verdicts),
        *_nominal_unjudged(world),
        *_lost(world),
    )
    graph_s = (world.scheduler.now_ns - begun_ns) / S
    called = dict.fromkeys(
        f"{v.outcome.value} {', '.join(m.fault for m in v.members) or v.words[:200]}"
        for _, v in verdicts
        if v.outcome in CALLED
    )
    found = any(world.run.fault in _names(v) for _, v in verdicts)
    return Judged(seed, world.words, graph_s, world.trace.hexdigest(), wrong, tuple(called), found)


def _verdicts(world: World) -> Iterator[tuple[int, AmbiguityGroup]]:
    for at_ns, topic, data in world.said:
        if topic == "/ambiguity_group":
            yield at_ns, decode(AmbiguityGroup, data)


def _names(verdict: AmbiguityGroup) -> tuple[str, ...]:
    return tuple(member.fault for member in verdict.members) if verdict.outcome in CALLED else ()


def _ended_badly(world: World) -> Iterator[str]:
    """No process ends but by an error that is raised on purpose, in one line."""
    for name, process in world.processes.items():
        ended = process.node.raised or process.finished.value
        if ended is None:
            continue
        if not isinstance(ended, FleaError):
            yield f"{name} ended with {type(ended).__name__}: {ended}"
        elif line_of(str(ended)) != str(ended):
            yield f"{name} ended with several lines: {ended}"
        elif not world.disk.failed:
            yield f"{name} ended without reason: {ended}"


def _wrong_names(world: World, verdicts: list[tuple[int, AmbiguityGroup]]) -> Iterator[str]:
    """No fault is isolated but the one that there is."""
    for at_ns, verdict in verdicts:
        if verdict.outcome is Outcome.ISOLATED and _names(verdict) != (world.run.fault,):
            at_s = (at_ns - world.begun_ns) / S
            yield f"at {at_s:.1f} s ISOLATED {_names(verdict)[0]}: {verdict.words[:120]}"
            return


def _nominal_unjudged(world: World) -> Iterator[str]:
    """No NOMINAL is said after a long time in which the friction relation had no value.

    Seen from the residuals alone, not from what the diagnosis says that it judged.
    """
    finite: deque[int] = deque(maxlen=1)
    first_ns = 0
    for at_ns, topic, data in world.said:
        if topic == "/residual":
            first_ns = first_ns or at_ns
            record = decode(Residual, data)
            pairs = zip(record.names, record.z, strict=True)
            if any(name.startswith(FRICTION) and math.isfinite(z) for name, z in pairs):
                finite.append(at_ns)
        elif topic == "/ambiguity_group" and first_ns:
            verdict = decode(AmbiguityGroup, data)
            since_ns = at_ns - (finite[-1] if finite else first_ns)
            unjudged = verdict.outcome is Outcome.NOMINAL and not verdict.stale
            if unjudged and since_ns > UNJUDGED_NS:
                yield f"NOMINAL after {since_ns / S:.1f} s without {FRICTION}: {verdict.words[:80]}"
                return


def _lost(world: World) -> Iterator[str]:
    """What the recorder was given is in its bags, but for the last second of one that was ended."""
    ends_ns = world.recorder_ends_ns
    return missing_from(world.folder, world.taken, ends_ns, world.begun_ns, world.foreign)


def missing_from(
    folder: Path,
    taken: list[tuple[str, bytes, int]],
    ends_ns: list[int],
    begun_ns: int,
    foreign: int = 0,
) -> Iterator[str]:
    """Whether all bags of a folder can be read, and hold what the recorder was given.

    ``taken`` are topic, bytes and clock of the host at each message, ``ends_ns`` the times at which
    a recorder was ended without notice: what came in the second around it may be lost. ``foreign``
    messages were counted as those of a second source, and not used.
    """
    kept: Counter[tuple[str, bytes, int]] = Counter()
    for file in sorted(folder.glob("bag_*[0-9]/*.mcap")):
        try:
            with file.open("rb") as stream:
                rows = make_reader(stream).iter_messages(log_time_order=False)
                kept.update((c.topic, m.data, m.log_time) for _, c, m in rows)
        except McapError as error:
            yield f"{file.name} cannot be read: {error}"
    for topic, data, at_ns in taken:
        if kept[topic, data, at_ns]:
            kept[topic, data, at_ns] -= 1
        elif topic.startswith("/sensors") and foreign > 0:
            foreign -= 1
        elif not any(-LOST_NS <= end_ns - at_ns <= LOST_NS for end_ns in ends_ns):
            yield f"a message on {topic} at {(at_ns - begun_ns) / S:.1f} s is in no bag"
            return
