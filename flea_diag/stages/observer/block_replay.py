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

"""Scans in blocks for a fast replay, with the results of single scans.

A block is processed as a whole. If it holds an event, the observer goes back to its last
checkpoint, repeats the quiet scans, and leaves the scan with the event to be taken alone.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from flea_diag.core.state_copy import state_copy
from flea_diag.stages.observer.observer_chain import ObserverChain
from flea_diag.stages.observer.residual_stream import StreamOutput
from flea_diag.wire.blocks import ScanBlock

LEAST_SCANS, MOST_SCANS = 16, 2048
"""Fewest scans that are worth a block, and most scans of one."""
WORTH_SCANS = 8
"""Scans that take as long alone as in a block for which the state is copied."""
MOST_BLOCKS = 64
"""Most blocks to repeat after an event: live, where a block has a few scans, seconds of them."""
QUIET_SHARE, MOST_REPEATED = 8, 32_768
"""Scans to repeat after an event: one of so many that were quiet before, and so many at most."""


@dataclass
class Checkpoint:
    """State to which the observer can go back, and the quiet blocks since then.

    Copying the state costs as much as some hundred scans, and blocks between vibration are short:
    a copy is made now and then, and the blocks since then are repeated. ``most``: how many scans
    may be; the longer it was quiet, the more, for an event is then as rare.
    """

    chain: ObserverChain
    most: int = MOST_SCANS
    blocks: list[ScanBlock] = field(default_factory=list)
    scans: int = 0

    def take(self, block: ScanBlock) -> None:
        """Add a quiet block."""
        self.blocks.append(block)
        self.scans += len(block)

    @property
    def is_old(self) -> bool:
        """Whether a new copy costs less than repeating what has come since this one."""
        return self.scans >= self.most or len(self.blocks) >= MOST_BLOCKS

    def restored(self) -> ObserverChain:
        """The state after the last quiet block, repeated in as few blocks as the chain takes."""
        chain = state_copy(self.chain)
        for rest in ScanBlock.joined(self.blocks):
            while len(rest):
                count = chain.leading(rest)
                chain.follow(rest.part(slice(count)))
                rest = rest.part(slice(count, None))
        return chain


class BlockReplay:
    """Takes leading quiet scans; blocks start small after an event, for events cluster."""

    def __init__(self) -> None:
        self._most = LEAST_SCANS
        self._quiet = 0
        """Scans since the last event."""
        self._checkpoint: Checkpoint | None = None
        self._alone = 0
        """Scans of short blocks that are left alone yet, for the last copy was hardly used."""

    def forget(self) -> None:
        """Drop the checkpoint: the state changes in another way than by a block."""
        if self._checkpoint is not None and self._checkpoint.scans < WORTH_SCANS:
            self._alone = WORTH_SCANS
        self._checkpoint = None

    def take(
        self, chain: ObserverChain, block: ScanBlock
    ) -> tuple[ObserverChain, int, StreamOutput | None]:
        """Take the leading scans that cause residuals and nothing else.

        Returns
        -------
        The state after them, their number, and their output (None if there are none).
        """
        count = chain.leading(block.part(slice(self._most)))
        if count < min(LEAST_SCANS, len(block)):
            return chain, 0, None
        if self._checkpoint is None and self._alone and len(block) < WORTH_SCANS:
            self._alone -= 1
            return chain, 0, None
        if self._checkpoint is None or self._checkpoint.is_old:
            most = max(MOST_SCANS, min(self._quiet // QUIET_SHARE, MOST_REPEATED))
            self._checkpoint = Checkpoint(state_copy(chain), most)
        part = block.part(slice(count))
        quiet, output = chain.follow(part)
        if quiet == count:
            self._most = min(2 * self._most, MOST_SCANS)
            self._quiet += quiet
            self._checkpoint.take(part)
            return chain, quiet, output
        self._most, self._quiet = LEAST_SCANS, 0
        checkpoint, self._checkpoint = self._checkpoint, None
        # A condition that begins in a block voids its relations in all of it: without the scans
        # from there on an earlier event may show.
        while quiet < count:
            chain, count = checkpoint.restored(), quiet
            if not count:
                return chain, 0, None
            quiet, output = chain.follow(block.part(slice(count)))
        return chain, quiet, output
