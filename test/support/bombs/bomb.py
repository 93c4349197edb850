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

"""One bomb: a row that makes an input, and what must become of it."""

from __future__ import annotations

import io
import threading
from collections.abc import Callable
from contextlib import redirect_stdout
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from random import Random
from tempfile import mkdtemp

from flea_diag.tools.main import main
from support.places import ROOT

REFUSED = "refused"
"""Exit status 2 and one line on standard error."""
TOLD = "told"
"""Any exit status, and words: what is wrong is named, or what was read is reported."""


@dataclass(frozen=True)
class Input:
    """One input: ``read`` reads it, prints, and returns an exit status.

    ``says`` are words of which one must be printed; ``meanwhile`` runs beside ``read``, again and
    again, and changes the input.
    """

    read: Callable[[], int]
    ends: str = REFUSED
    says: tuple[str, ...] = ()
    meanwhile: Callable[[], None] | None = None

    def run(self) -> int:
        """Read it, changing or not; exit status."""
        if self.meanwhile is None:
            return self.read()
        over = threading.Event()
        changing = threading.Thread(target=_again_and_again, args=(self.meanwhile, over))
        changing.start()
        try:
            return self.read()
        finally:
            over.set()
            changing.join()


Make = Callable[[Path, Random], Input]
"""Makes an input in an empty folder, at random."""


@cache
def imported() -> None:
    """Import and compile what the commands use, so that no input pays for it."""
    with redirect_stdout(io.StringIO()):
        main(["replay", str(ROOT / "bags" / "winding_short")])
        main(["simulate", "jam", "-o", f"{mkdtemp()}/bag", "--duration", "12", "--no-vibration"])


@dataclass(frozen=True)
class Bomb:
    """A row of a gate's table."""

    gate: str
    name: str
    make: Make
    prepare: Callable[[], object] = imported
    """Imports what every row of the gate needs, once and before its processes."""


def rows(gate: str, *makers: Make, prepare: Callable[[], object] = imported) -> tuple[Bomb, ...]:
    """Rows of a gate; each is named after its function."""
    return tuple(
        Bomb(gate, make.__name__.replace("_", " ").strip(), make, prepare) for make in makers
    )


def flea(*arguments: object) -> Callable[[], int]:
    """The command with these arguments."""
    return lambda: main([str(argument) for argument in arguments])


def several(low: int, high: int, chance: Random) -> int:
    """A number between two, each order of magnitude as likely as another."""
    return round(low * (high / low) ** chance.random())


def _again_and_again(change: Callable[[], None], over: threading.Event) -> None:
    while not over.wait(0.001):
        try:
            change()
        except OSError:
            continue
