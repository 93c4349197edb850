"""Scans in blocks, as fast as a replay wants them, with what single scans would cause.

A block is followed whole. Where something happens in it, the observer goes back to its last
checkpoint, follows the quiet scans once more, and leaves the eventful one to be taken alone.
"""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass, field

from flea_diag.stages.observer.observer_chain import ObserverChain
from flea_diag.stages.observer.residual_stream import StreamOutput
from flea_diag.wire.blocks import ScanBlock

LEAST_SCANS, MOST_SCANS = 16, 1024
"""Scans that are worth a block, and that one may hold."""


@dataclass
class Checkpoint:
    """State to which the observer can go back, and the quiet blocks since then.

    A copy of the state takes as long as two scans, and short blocks come between those of
    vibration: so it is made now and then, and what has passed since is followed once more.
    """

    chain: ObserverChain
    blocks: list[ScanBlock] = field(default_factory=list)
    scans: int = 0

    def take(self, block: ScanBlock) -> None:
        """One more quiet block."""
        self.blocks.append(block)
        self.scans += len(block)

    def restored(self) -> ObserverChain:
        """The state at the end of the last quiet block; the checkpoint is used up."""
        for block in self.blocks:
            self.chain.follow(block)
        return self.chain


class BlockReplay:
    """Follows leading quiet scans; after an event blocks start small: it seldom comes alone."""

    def __init__(self) -> None:
        self._most = LEAST_SCANS
        self._checkpoint: Checkpoint | None = None

    def forget(self) -> None:
        """The state changes otherwise than by a block: there is no way back across that."""
        self._checkpoint = None

    def take(
        self, chain: ObserverChain, block: ScanBlock
    ) -> tuple[ObserverChain, int, StreamOutput | None]:
        """Follow the leading scans that cause residuals and nothing else.

        Returns
        -------
        The state after them, how many they are, and what they gave (None: there are none).
        """
        count = chain.leading(block.part(slice(self._most)))
        if count < min(LEAST_SCANS, len(block)):
            return chain, 0, None
        if self._checkpoint is None or self._checkpoint.scans >= MOST_SCANS:
            self._checkpoint = Checkpoint(deepcopy(chain))
        part = block.part(slice(count))
        quiet, output = chain.follow(part)
        if quiet == count:
            self._most = min(2 * self._most, MOST_SCANS)
            self._checkpoint.take(part)
            return chain, quiet, output
        self._most = LEAST_SCANS
        chain, self._checkpoint = self._checkpoint.restored(), None
        if not quiet:
            return chain, 0, None
        _, output = chain.follow(block.part(slice(quiet)))
        return chain, quiet, output
