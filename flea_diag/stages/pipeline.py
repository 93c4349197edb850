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

"""Several stages as one: what one of them returns is handed on to those that consume it."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import cast

from flea_diag.stages import BlockStage, Stage
from flea_diag.wire.blocks import Block, ResidualBlock, ScanBlock
from flea_diag.wire.records import DataQuality, Record, Residual, Scan

IN_BLOCKS: dict[type, type] = {ScanBlock: Scan, ResidualBlock: Residual}


class Pipeline:
    """A stage made of stages; drives replay, tests and the one-process diagnoser.

    ``handle`` returns every record that ``record`` caused, in causal order, each before
    the records that it caused in turn.
    """

    def __init__(self, stages: Sequence[Stage]) -> None:
        self._stages = tuple(stages)
        self.consumes: tuple[type, ...] = tuple(
            dict.fromkeys(kind for stage in self._stages for kind in stage.consumes)
        )
        # Whether a stage takes blocks at all is asked first, each time: see ``_takes_blocks``.
        self._of_record = {
            kind: [stage.handle for stage in self._stages if kind in stage.consumes]
            for kind in self.consumes
        }
        self._of_block: dict[type, list[BlockStage]] = {
            block: [cast(BlockStage, stage) for stage in self._stages if kind in stage.consumes]
            for block, kind in IN_BLOCKS.items()
        }

    def handle(self, record: Record) -> tuple[Record, ...]:
        """Run ``record`` and all that follows from it through the stages that consume it."""
        return self._run(deque([record]))

    def handle_block(self, block: ScanBlock) -> tuple[Record | Block, ...]:
        """Run scans through the stages: what they cause, quiet stretches of it in blocks."""
        caused: list[Record | Block] = []
        while len(block):
            taken, made = self._quiet(block)
            if not taken:
                taken, made = 1, self.handle(next(block.part(slice(1)).records()))
            caused.extend(made)
            block = block.part(slice(taken, None))
        return tuple(caused)

    def _quiet(self, block: ScanBlock) -> tuple[int, tuple[Record | Block, ...]]:
        """The leading scans that may pass as blocks, and what they cause.

        Stages that read scans must all be willing; residuals go one by one to those that,
        just then, take no blocks of them.
        """
        readers = self._of_block[ScanBlock]
        if not all(_takes_blocks(stage) for stage in readers):
            return 0, ()
        taken, caused = len(block), []
        waiting: deque[Record | Block] = deque()
        for stage in readers:
            # The first one says how many; those after it follow.
            taken, made = stage.handle_block(block.part(slice(taken)))
            if not taken:
                return 0, ()
            waiting.extend(made)
        while waiting:
            current = waiting.popleft()
            caused.append(current)
            if not isinstance(current, Block):
                caused.extend(self._run(deque([current])))
                continue
            takers = self._of_block[type(current)]
            if not all(map(_takes_blocks, takers)):
                alone, current = self._one_by_one(current)
                caused.extend(alone)
            for stage in takers if len(current) else ():
                waiting.extend(stage.handle_block(current)[1])
        return taken, tuple(caused)

    def _one_by_one(self, block: Block) -> tuple[list[Record], Block]:
        """What the leading records cause, until all stages take the rest, which may be empty."""
        caused: list[Record] = []
        takers, taken = self._of_block[type(block)], 0
        for record in block.records():
            taken += 1
            caused.extend(self._run(deque([record])))
            if all(map(_takes_blocks, takers)):
                break
        return caused, block.part(slice(taken, None))

    def finish(self) -> tuple[Record, ...]:
        """The input has ended: stages that still hold records back let them go."""
        caused: list[Record] = []
        for stage in self._stages:
            held: tuple[Record, ...] = getattr(stage, "finish", tuple)()
            caused.extend(held)
            caused.extend(self._run(deque(held)))
        return tuple(caused)

    def report(self) -> DataQuality | None:
        """How readings and judgement stand now, of the stage that watches them; None: of none."""
        reports = (getattr(stage, "report", lambda: None)() for stage in self._stages)
        return next((report for report in reports if report is not None), None)

    def reset(self) -> tuple[Record, ...]:
        """Close the open episode and arm again, in every stage that keeps one."""
        caused: list[Record] = []
        for stage in self._stages:
            closed: tuple[Record, ...] = getattr(stage, "reset", tuple)()
            caused.extend(closed)
            caused.extend(self._run(deque(closed)))
        return tuple(caused)

    def _run(self, waiting: deque[Record]) -> tuple[Record, ...]:
        caused: list[Record] = []
        while waiting:
            current = waiting.popleft()
            for handle in self._of_record.get(type(current), ()):
                produced = handle(current)
                caused.extend(produced)
                waiting.extend(produced)
        return tuple(caused)


def _takes_blocks(stage: Stage) -> bool:
    return bool(getattr(stage, "takes_blocks", False))
