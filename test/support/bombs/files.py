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

"""Paths that lead to no file, to an endless one, or to one that changes while it is read."""

from __future__ import annotations

import os
import shutil
import socket
from collections.abc import Callable
from pathlib import Path
from random import Random

from support.bombs.bomb import TOLD, Input, flea, rows
from support.places import ROOT

BAG = ROOT / "bags" / "winding_short"
SCENARIO = ROOT / "config" / "scenarios" / "jam.yaml"
CAMPAIGN = ROOT / "config" / "campaigns" / "small.yaml"

Command = Callable[[Path], tuple[object, ...]]
COMMANDS: dict[str, Command] = {
    "a.mcap": lambda path: ("replay", path),
    "b.mcap": lambda path: ("bag", "check", path),
    "c.mcap": lambda path: ("recover", path, "-o", path.parent / "out"),
    "s.yaml": lambda path: ("simulate", path, "-o", path.parent / "out"),
    "k.yaml": lambda path: ("evaluate", path, "-o", path.parent / "out", "-q"),
    "c.yaml": lambda path: ("replay", BAG, "--calibration", path),
    "t.yaml": lambda path: ("features", "tree", path),
    "a.json": lambda path: ("diff", path, path),
    "results.jsonl": lambda path: ("diff", path, path),
    "BatchProfile_sine12_2010_Nominal_Low.data": (
        lambda path: ("import", path, "-o", path.parent / "out")
    ),
}
"""A name that a command looks for, and the command that reads it."""


def _of(folder: Path, chance: Random) -> tuple[Path, Input]:
    name = chance.choice(list(COMMANDS))
    path = folder / name
    # One recording of several that is refused leaves the others: exit status 1 where all are.
    return path, Input(flea(*COMMANDS[name](path)), TOLD, (name,))


def a_fifo(folder: Path, chance: Random) -> Input:
    path, found = _of(folder, chance)
    os.mkfifo(path)
    return found


def a_device(folder: Path, chance: Random) -> Input:
    path, found = _of(folder, chance)
    path.symlink_to(chance.choice(("/dev/zero", "/dev/random", "/dev/full")))
    return found


def a_folder(folder: Path, chance: Random) -> Input:
    path, found = _of(folder, chance)
    path.mkdir()
    return found


def a_socket(folder: Path, chance: Random) -> Input:
    path, found = _of(folder, chance)
    here = os.getcwd()
    os.chdir(folder)  # the address of a socket is short
    try:
        with socket.socket(socket.AF_UNIX) as server:
            server.bind(path.name)
    finally:
        os.chdir(here)
    return found


def a_circle_of_links(folder: Path, chance: Random) -> Input:
    path, found = _of(folder, chance)
    path.symlink_to(path)
    return found


def a_hole(folder: Path, chance: Random) -> Input:
    """A terabyte of zeros that takes no room."""
    path, found = _of(folder, chance)
    path.touch()
    os.truncate(path, 1 << chance.randint(31, 42))
    return found


def _bag(folder: Path, chance: Random) -> tuple[Path, tuple[object, ...]]:
    """A copy of a whole bag, and a command that reads it."""
    bag = folder / "bag"
    shutil.copytree(BAG, bag)
    file = next(bag.glob("*.mcap"))
    commands = (("replay", bag), ("bag", "check", bag), ("recover", bag, "-o", folder / "out"))
    return file, chance.choice(commands)


def that_grows(folder: Path, chance: Random) -> Input:
    """A bag to which somebody appends without end."""
    file, command = _bag(folder, chance)
    part = chance.randbytes(1 << 16)

    def grow() -> None:
        if file.stat().st_size < 200 << 20:
            with file.open("ab") as stream:
                stream.write(part)

    return Input(flea(*command), TOLD, meanwhile=grow)


def that_is_cut(folder: Path, chance: Random) -> Input:
    file, command = _bag(folder, chance)

    def cut() -> None:
        os.truncate(file, int(file.stat().st_size * chance.uniform(0.5, 1.0)))

    return Input(flea(*command), TOLD, meanwhile=cut)


def that_vanishes(folder: Path, chance: Random) -> Input:
    file, command = _bag(folder, chance)
    whole = file.read_bytes()

    def vanish() -> None:
        if file.exists():
            file.unlink()
        else:
            file.write_bytes(whole)

    return Input(flea(*command), TOLD, meanwhile=vanish)


def that_becomes_a_fifo(folder: Path, chance: Random) -> Input:
    file, command = _bag(folder, chance)
    other = folder / "other"
    os.mkfifo(other)

    def change() -> None:
        kept = folder / "kept"
        file.rename(kept)
        other.rename(file)
        file.rename(other)
        kept.rename(file)

    return Input(flea(*command), TOLD, meanwhile=change)


def of_two_contents(folder: Path, chance: Random) -> Input:
    """A scenario that is rewritten, in place, while it is read."""
    path = folder / "s.yaml"
    whole = SCENARIO.read_bytes()
    path.write_bytes(whole)

    def change() -> None:
        path.write_bytes(whole if chance.random() < 0.5 else whole[: chance.randrange(len(whole))])

    command = flea("simulate", path, "-o", folder / "out", "--duration", 12, "--no-vibration")
    return Input(command, TOLD, ("s.yaml", "out"), meanwhile=change)


FILES = rows(
    "file", a_fifo, a_device, a_folder, a_socket, a_circle_of_links, a_hole, that_grows,
    that_is_cut, that_vanishes, that_becomes_a_fifo, of_two_contents,
)  # fmt: skip
