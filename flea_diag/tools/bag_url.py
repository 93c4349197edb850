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

"""Bags at a URL (``https://``, ``s3://``, what else fsspec knows), copied while they are read."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from flea_diag.errors import FleaError, RecordingError, line_of, shown
from flea_diag.tools.extra import require
from flea_diag.tools.terminal import fetched
from flea_diag.tools.web_access import last_part, web_options, without_credentials

MARK = "://"
MOST_BYTES = 16 << 30
MOST_FILES = 1000
PIECE_BYTES = 1 << 20
CAUSE_LENGTH = 200
LONGEST = 2000
"""Most characters of an address."""
LONGEST_NAME = 200
"""Most characters of the name of a copy."""


@dataclass(frozen=True)
class BagUrl:
    """Address of a bag: of its folder, or of a single .mcap file; printed without credentials."""

    url: str

    def __str__(self) -> str:
        return without_credentials(self.url)

    __repr__ = __str__

    @property
    def name(self) -> str:
        """Last part of the address."""
        return last_part(self.url)

    def absolute(self) -> BagUrl:
        """The same: an address holds everywhere."""
        return self

    resolve = absolute


def bag_place(text: str) -> Any:
    """Path or ``BagUrl`` of a bag on the command line."""
    if MARK not in text:
        return Path(text)
    bag = BagUrl(text.rstrip("/"))
    require("url", f"a bag at {shown(str(bag))}")
    if len(text) > LONGEST or bag.name in ("", ".", ".."):
        raise RecordingError(
            f"{shown(str(bag))} is no address of a bag: it must end in the name of a folder or of "
            f"an .mcap file, and have at most {LONGEST} characters"
        )
    return bag


@contextmanager
def local(bag: Any) -> Iterator[Path]:
    """Where the bag can be read: a path as it is, a ``BagUrl`` in a temporary folder.

    Raises
    ------
    RecordingError
        It cannot be fetched, or is larger than is fetched.
    """
    if not isinstance(bag, BagUrl):
        yield bag
        return
    with tempfile.TemporaryDirectory(prefix="flea_bag_") as folder:
        place = Path(folder) / bag.name[-LONGEST_NAME:]
        try:
            _fetch(bag.url, place)
            yield place
        except FleaError as error:  # what is said of the copy holds for the address
            raise type(error)(str(error).replace(str(place), str(bag))) from None


def _fetch(url: str, place: Path) -> None:
    """Copy a .mcap file, or the files that the description of a bag lists."""
    from flea_diag.wire.bags.bag_description import LARGEST_BYTES, described
    from flea_diag.wire.bags.bag_layout import METADATA_FILE

    left = min(MOST_BYTES, shutil.disk_usage(place.parent).free // 2)
    if url.endswith(".mcap"):
        _copy(url, place, left)
        return
    place.mkdir()
    _copy(f"{url}/{METADATA_FILE}", place / METADATA_FILE, LARGEST_BYTES)
    losses: list[str] = []
    known = described(place, losses)
    if known is None:
        raise RecordingError(f"{BagUrl(url)}: {'; '.join(losses)}")
    if len(known.files) > MOST_FILES:
        raise RecordingError(
            f"{BagUrl(url)}: {len(known.files)} files, at most {MOST_FILES} are fetched"
        )
    for name in (Path(file).name for file in known.files):
        left -= _copy(f"{url}/{name}", place / name, left)


def _copy(url: str, target: Path, limit_bytes: int) -> int:
    """Copy one file of at most so many bytes; its size."""
    import fsspec

    size, name = 0, str(BagUrl(url))
    try:
        opened = fsspec.open(url, "rb", **web_options(url))
        with opened as source, target.open("wb") as copy:
            while piece := source.read(PIECE_BYTES):
                size += len(piece)
                if size > limit_bytes:
                    raise RecordingError(
                        f"{name}: more than {limit_bytes} bytes: fetch it yourself"
                    )
                copy.write(piece)
                fetched(name, size)
    except RecordingError as error:
        raise RecordingError(str(error).replace(url, name)) from None
    except Exception as error:  # each protocol has errors of its own
        first = error.__cause__ or error
        cause = line_of(f"{type(first).__name__}: {first}".replace(url, name))[:CAUSE_LENGTH]
        raise RecordingError(f"{name}: cannot be fetched ({cause})") from None
    return size
