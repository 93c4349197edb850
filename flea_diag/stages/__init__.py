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

"""Records in, records out: the one contract between the science and everything around it."""

from __future__ import annotations

from typing import Any, Protocol

from flea_diag.wire.blocks import Block
from flea_diag.wire.records import Record


class Stage(Protocol):
    """Takes one record and returns the records that it causes.

    Time comes only from record stamps and randomness only from an injected generator, so
    the live graph, the replay and the tests run the same code and give the same answers.
    """

    consumes: tuple[type, ...]

    def handle(self, record: Record) -> tuple[Record, ...]:
        """Records caused by ``record``, in the order in which they are to be published."""
        ...


class BlockStage(Stage, Protocol):
    """A stage that also takes many records of one kind at once, in a replay.

    The answer is the same as that of ``handle`` for the records one by one, in which stretches
    of records of one kind may again be blocks. A stage need not have this.
    """

    @property
    def takes_blocks(self) -> bool:
        """Whether a block may come now: nothing that waits could have a say within it."""
        ...

    def handle_block(self, block: Any) -> tuple[int, tuple[Record | Block, ...]]:
        """Take leading records of a block: how many, and what they cause.

        The stage that makes residuals takes those that cause nothing else, perhaps none;
        what follows goes through ``handle``. All others take every one.
        """
        ...
