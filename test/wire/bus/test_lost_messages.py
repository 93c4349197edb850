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

"""Messages lost on the way are counted by the numbers of their writer, whichever executor takes."""

from __future__ import annotations

import pytest
import rclpy.executors
import rclpy.experimental
from support.live import Peer

from flea_diag.wire.bus.numbered.lost_messages import SETTLED, LostMessages
from flea_diag.wire.messages import codec
from flea_diag.wire.records import Residual

SENT = 3000


@pytest.mark.parametrize(
    ("numbers", "lost"),
    [
        ([7, 8, 9], [0, 0, 0]),  # who joins late has lost nothing
        ([7, 9, 13], [0, 1, 3]),
        ([40, 41, 1, 2], [0, 0, 0, 0]),  # the writer was started again
        ([40, 1, *range(2, SETTLED + 2), SETTLED + 4], [*[0] * (SETTLED + 2), 2]),
        ([5, None, 9], [0, 0, 0]),  # a middleware without numbers
    ],
)
def test_missing_numbers_of_one_writer_are_lost(numbers: list[int], lost: list[int]) -> None:
    count = LostMessages(lambda: 1)
    assert [count.before(number) for number in numbers] == lost


def test_numbers_of_several_writers_are_not_compared() -> None:
    writers = [2]
    count = LostMessages(lambda: writers[0])
    mixed = [n for k in range(20) for n in (5 + k, 900 + k)]
    assert {count.before(number) for number in mixed} == {0}
    # One of them has gone; the other goes on from where it was.
    writers[0] = 1
    assert count.before(25) == 0
    assert count.before(27) == 0
    assert sum(map(count.before, [*range(28, 28 + SETTLED), 30 + SETTLED])) == 2


@pytest.mark.parametrize("kind", ["EventsExecutor", "SingleThreadedExecutor"])
def test_what_was_sent_is_received_or_counted_as_lost(domain: int, kind: str) -> None:
    """A flood, taken by each executor of rclpy: they pass the number in different ways."""
    with Peer(domain, name="writer") as writer, Peer(domain, name="reader") as reader:
        taking(reader, kind)
        stream = reader.bus.subscribe_raw(Residual, lambda data: None, depth=5)
        assert writer.heard(Residual)
        data = codec.encode(Residual(1, ("r",), (0.0,), (0.0,), (5.0,)), "stand")
        while not stream.received:  # a writer knows its reader before the reader knows the writer
            writer.bus.publish_raw(Residual, data)
            reader.bus.wait_until(lambda: bool(stream.received), 0.05)
        reader.bus.wait_until(lambda: False, 0.1)
        before = stream.received + stream.lost
        for _ in range(SENT):
            writer.bus.publish_raw(Residual, data)
        reader.until(lambda: stream.received + stream.lost == before + SENT)
        assert 0 < stream.lost < SENT


def taking(reader: Peer, kind: str) -> None:
    """Have another executor take what the peer has subscribed to."""
    executors = rclpy.experimental if kind == "EventsExecutor" else rclpy.executors
    reader.bus._executor.remove_node(reader.node)
    reader.bus._executor = getattr(executors, kind)(context=reader.node.context)
    reader.bus._executor.add_node(reader.node)
