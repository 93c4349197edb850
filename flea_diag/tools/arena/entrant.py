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

"""Who enters the arena: a diagnoser of others by its name on the command line."""

from __future__ import annotations

import hashlib
import re
import shlex
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from importlib.metadata import entry_points
from pathlib import Path

from flea_diag.errors import ConfigurationError, shown

GROUP = "flea_diag.diagnosers"
"""Entry points of installed packages: name -> class."""
PROCESS, NODE = "process:", "node:"
HOST = (sys.executable, "-m", "flea_diag.tools.arena.host")
BRIDGE = (sys.executable, "-m", "flea_diag.nodes.run.arena_bridge")
_LABEL = re.compile(r"[A-Za-z][\w.-]{0,39}")
_LABELLED = re.compile(r"([A-Za-z][\w.-]{0,39})=(.+)", re.DOTALL)


@dataclass(frozen=True)
class Entrant:
    """One diagnoser of others.

    Parameters
    ----------
    label
        Its name in tables and files.
    command
        What is started for each run; it answers every line of JSON by one.
    content
        Digest of the file that it is in, where there is one: results of another do not count.
    """

    label: str
    command: tuple[str, ...]
    content: str = ""


@dataclass(frozen=True)
class Arena:
    """All entrants, and what each of their runs may take."""

    entrants: tuple[Entrant, ...] = ()
    limit_s: float = 120.0
    memory_mb: int = 1024

    def find(self, label: str) -> Entrant | None:
        """The entrant of this label."""
        return next((each for each in self.entrants if each.label == label), None)

    def plan(self) -> str:
        """What the results depend on, as one text; empty without entrants."""
        return repr([(each.label, each.content) for each in self.entrants]) if self.entrants else ""


def entrants(named: Iterable[str], taken: Iterable[str]) -> tuple[Entrant, ...]:
    """Diagnosers as the command line names them; ``taken`` are names of our own.

    Raises
    ------
    ConfigurationError
        One cannot be found, or two have the same label.
    """
    found: list[Entrant] = []
    used = set(taken)
    for text in named:
        made = entrant(text)
        if made.label in used:
            raise ConfigurationError(
                f"--diagnoser {shown(text)}: {made.label} is taken, name it: LABEL={text}"
            )
        used.add(made.label)
        found.append(made)
    return tuple(found)


def entrant(text: str) -> Entrant:
    """One diagnoser: ``[LABEL=]`` and FILE.py:CLASS, MODULE:CLASS, an entry point, or a command.

    Raises
    ------
    ConfigurationError
        There is no such file or entry point.
    """
    labelled = _LABELLED.fullmatch(text)
    label, place = (labelled[1], labelled[2]) if labelled else ("", text)
    for mark, through in ((PROCESS, ()), (NODE, BRIDGE)):
        if place.startswith(mark):
            command = shlex.split(place.removeprefix(mark))
            if not command:
                raise ConfigurationError(f"--diagnoser {shown(text)}: name a command after {mark}")
            return Entrant(label or _word(command[-1]), (*through, *command))
    if ":" not in place:
        return Entrant(label or place, (*HOST, _entry_point(place)))
    module, _, name = place.rpartition(":")
    if not module.endswith(".py"):
        return Entrant(label or _word(name), (*HOST, place))
    file = Path(module).absolute()
    if not file.is_file():
        raise ConfigurationError(f"--diagnoser {shown(text)}: no file {file}")
    digest = hashlib.sha256(file.read_bytes()).hexdigest()
    return Entrant(label or _word(name), (*HOST, f"{file}:{name}"), digest)


def _entry_point(name: str) -> str:
    known = {each.name: each.value for each in entry_points(group=GROUP)}
    if name not in known:
        has = ", ".join(sorted(known)) or "none"
        raise ConfigurationError(
            f"--diagnoser {shown(name)}: no package installed here names it under {GROUP} (there "
            f"are {has}); give FILE.py:CLASS, MODULE:CLASS, process:COMMAND or node:COMMAND"
        )
    return known[name]


def _word(text: str) -> str:
    """A label out of a class or file name."""
    plain = re.sub(r"[^\w.-]+", "_", Path(text).stem)[:40]
    return plain if _LABEL.fullmatch(plain) else f"d{plain}"[:40]
