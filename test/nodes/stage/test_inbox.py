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

"""Scans that wait are handled in blocks: the same diagnosis as one by one."""

from __future__ import annotations

from support.decisions import BAGS
from support.live import Peer

from flea_diag.configuration.component import DIAGNOSER
from flea_diag.nodes.stage.adapter import Adapter
from flea_diag.nodes.stage.inbox import MOST_WAITING, Inbox, Turns
from flea_diag.nodes.stage.ports import StagePorts
from flea_diag.nodes.stage.verdict_memory import NONE, VerdictMemory
from flea_diag.stages.digest import digest
from flea_diag.stages.pipeline import Pipeline
from flea_diag.wire.bags.bag import BagReader
from flea_diag.wire.blocks import Block, ResidualBlock, ScanBlock
from flea_diag.wire.records import AmbiguityGroup, ChannelTable, Outcome, Record, Residual, Scan
from flea_diag.wire.topics import TOPIC_OF

AHEAD = 60
"""Scans that are sent before those before them have been handled."""
PORTS = StagePorts(subscribes=(ChannelTable, Scan), publishes=())


class Noted(Pipeline):
    """The diagnosis, which keeps what it said and how many scans came together."""

    def __init__(self, whole: Pipeline) -> None:
        super().__init__(whole._stages)
        self.said: list[Record] = []
        self.sizes: list[int] = []
        self._in_block = False

    def handle(self, record: Record) -> tuple[Record, ...]:
        made = super().handle(record)
        if not self._in_block:
            self.said.extend(made)
            self.sizes.extend([1] * isinstance(record, Scan))
        return made

    def handle_block(self, block: ScanBlock) -> tuple[Record | Block, ...]:
        self._in_block = True
        made = super().handle_block(block)
        self._in_block = False
        self.said.extend(each for each in made if not isinstance(each, Block))
        self.sizes.append(len(block))
        return made


def diagnosis() -> Noted:
    whole = DIAGNOSER.build(DIAGNOSER.parameters())
    assert isinstance(whole, Pipeline)
    return Noted(whole)


def test_batches_decide_what_single_scans_decide(domain: int) -> None:
    records = [r for _, r in BagReader(BAGS / "winding_short").records((ChannelTable, Scan))]
    singly, batched = diagnosis(), diagnosis()
    for record in records:
        singly.handle(record)
    with Peer(domain, name="source") as source, Peer(domain, name="node") as node:
        turns = Turns(node.bus, batch_ms=20)
        memory = VerdictMemory(node.bus, NONE)
        Adapter(node.bus, lambda _: batched, None, PORTS, memory, turns)
        assert source.heard(ChannelTable, Scan)
        sent = 0
        for record in records:
            source.bus.publish(record)
            sent += isinstance(record, Scan)
            if sent % AHEAD == 0 or record is records[-1]:
                node.until(lambda sent=sent: sum(batched.sizes) == sent)
    assert max(batched.sizes) > 1
    assert digest(batched.said) == digest(singly.said)
    last = [record for record in batched.said if isinstance(record, AmbiguityGroup)][-1]
    assert last.outcome is Outcome.ISOLATED


def test_residuals_of_a_block_come_one_by_one_to_who_listens(domain: int) -> None:
    whole, bag = diagnosis(), BagReader(BAGS / "winding_short")
    caused = (
        whole.handle_block(r) if isinstance(r, ScanBlock) else whole.handle(r)
        for r in bag.blocks((ChannelTable, Scan))
    )
    block = next(r for some in caused for r in some if isinstance(r, ResidualBlock))
    block = block.part(slice(10))
    with Peer(domain, name="node") as node, Peer(domain, name="reader") as reader:
        node.bus.publish_block(block)  # to nobody: nothing is kept
        reader.listen(Residual)
        assert node.heard(Residual)
        node.bus.publish_block(block)
        last = block.stamps_ns[-1]
        reader.find(lambda record: record.stamp_ns == last)
    assert [repr(r) for r in reader.records] == [repr(r) for r in block.records()]


def test_of_a_stand_that_sends_too_much_all_that_waits_is_lost_at_once(domain: int) -> None:
    most, more, taken = max(MOST_WAITING, TOPIC_OF[Scan].depth), 10, []
    with Peer(domain, name="source") as source, Peer(domain, name="node") as node:
        turns = Turns(node.bus, batch_ms=1e6)  # none of its own
        inbox = Inbox(node.bus, turns, taken.append, lambda block: taken.append(block) is None)
        inbox.subscribe(Scan)
        stream = node.bus.streams[Scan]
        assert source.heard(Scan)
        for number in range(most + more):
            source.bus.publish(Scan((1 + number) * 10_000_000, ("a",), (0.0,)))
            node.until(lambda number=number: stream.received == 1 + number)
        assert stream.lost == most
        assert not inbox.turn()
    assert [len(block) for block in taken] == [more]
