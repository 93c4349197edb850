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

"""What is costly in a start, kept on disk by the content that it is made from.

An entry is a JSON text under a digest of all that it depends on: kind, inputs, sources of this
package, Python, numeric libraries, host. So no entry is ever out of date, all may be deleted at
any time, and what is damaged is made anew. Nothing of a recording is kept.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

from flea_diag.cache_folder import cache_folder
from flea_diag.core.backend import library_versions
from flea_diag.errors import FleaError
from flea_diag.wire.json_text import parse_json
from flea_diag.wire.regular_file import read_bytes

PACKAGE = Path(__file__).resolve().parents[1]
SOURCES = ("core", "configuration", "wire/yaml_text.py", "formats.py", "errors.py")
"""Parts of the package in whose hands an entry is made."""
NUMERIC = ("OPENBLAS_CORETYPE", "GLIBC_TUNABLES", "NPY_DISABLE_CPU_FEATURES")
"""Variables that choose other instructions, and with them other last digits."""
LARGEST_BYTES = 8 << 20
MOST_ENTRIES = 64
"""Entries that are kept; those that have waited longest for a use are deleted."""
ENTRY = re.compile(r"[a-z_]+-[0-9a-f]{32}\.json")
DIGEST = 64
"""Characters of a SHA-256, which every entry begins with."""


def kept(kind: str, inputs: tuple[str, ...], make: Callable[[], Any]) -> Any:
    """Content of the entry for these inputs, or else what ``make`` returns, which becomes it.

    Content of which JSON would make another value is returned and not kept. Where nothing can be
    read or written, everything is made each time.
    """
    place = _place(kind, inputs)
    if place is None:
        return make()
    with suppress(ValueError, FleaError):
        found = _read(place)
        _use(place)
        return found
    content = make()
    _write(place, content)
    return content


def _place(kind: str, inputs: tuple[str, ...]) -> Path | None:
    with suppress(OSError, RuntimeError):  # sources that cannot be read, a user without a home
        return cache_folder() / f"{kind}-{_key(kind, inputs)}.json"
    return None


def _key(kind: str, inputs: tuple[str, ...]) -> str:
    told = json.dumps([kind, *inputs, *_surroundings()])
    return hashlib.sha256(told.encode()).hexdigest()[:32]


@cache
def _surroundings() -> tuple[str, ...]:
    """What an entry depends on besides its inputs."""
    digest = hashlib.sha256()
    for file in _sources():
        digest.update(file.read_bytes())
    chosen = (os.environ.get(name, "") for name in NUMERIC)
    return (digest.hexdigest(), sys.version, library_versions(), *map(str, os.uname()), *chosen)


def _sources() -> Iterator[Path]:
    for part in (PACKAGE / name for name in SOURCES):
        yield from sorted(part.rglob("*.py")) if part.is_dir() else (part,)


def _read(place: Path) -> Any:
    """Content of an entry.

    Raises
    ------
    ValueError
        It is missing or damaged.
    """
    try:
        data = read_bytes(place, LARGEST_BYTES)
    except OSError as error:
        raise ValueError(str(error)) from error
    if data[:DIGEST] != _checksum(place, data[DIGEST:]):
        raise ValueError("damaged, or the entry of something else")
    return _parsed(data[DIGEST:].decode())


def _use(place: Path) -> None:
    """An entry that is in use is none of the oldest; where nothing can be written, it may be."""
    with suppress(OSError):
        os.utime(place)


def _parsed(text: str) -> Any:
    return parse_json(text, largest=LARGEST_BYTES, finite=False)


def _checksum(place: Path, data: bytes) -> bytes:
    return hashlib.sha256(place.name.encode() + data).hexdigest().encode()


def _write(place: Path, content: Any) -> None:
    """Write an entry atomically, whoever else writes the same one."""
    try:
        text = json.dumps(content, separators=(",", ":"))
        same = _parsed(text) == content
    except (TypeError, ValueError):
        return
    data = text.encode()
    if len(data) + DIGEST > LARGEST_BYTES or not same:
        return
    with suppress(OSError):
        write_whole(place, _checksum(place, data) + data)
        prune(place.parent, ENTRY)


def write_whole(place: Path, data: bytes) -> None:
    """Write a file atomically, with its folder."""
    place.parent.mkdir(parents=True, exist_ok=True)
    fresh = place.with_suffix(f".{os.getpid()}.new")
    fresh.write_bytes(data)
    fresh.replace(place)


def prune(folder: Path, entry_name: re.Pattern[str]) -> None:
    """Delete the oldest entries; whatever else lies in the folder is somebody's own."""
    ours = (entry for entry in folder.iterdir() if entry_name.fullmatch(entry.name))
    entries = sorted(ours, key=lambda entry: entry.stat().st_mtime)
    for entry in entries[:-MOST_ENTRIES]:
        entry.unlink()
