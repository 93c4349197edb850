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

"""Recordings as they were made, in place of bags: imported for as long as a command needs them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, NamedTuple

from flea_diag.errors import FleaError, RecordingError
from flea_diag.tools.bag_url import BagUrl
from flea_diag.tools.tables.readers import suffix_of
from flea_diag.tools.terminal import progress, warn
from flea_diag.wire.bags.foreign_bag import ForeignBag
from flea_diag.wire.records import Scan
from flea_diag.wire.topics import TOPIC_OF

if TYPE_CHECKING:
    from flea_diag.configuration.stand import Stand

FLEA_SUFFIX = ".data"


def is_bag_of_ours(path: Path) -> bool:
    """Whether a recording is a bag that holds scans."""
    return not suffix_of(path) and TOPIC_OF[Scan].name in ForeignBag(path).topics


class Bags(NamedTuple):
    """Recordings as bags, and why others are none; these reasons have been said.

    ``names``: what the user knows each bag by, the file that was given or a recording in it.
    """

    places: list[Path | BagUrl]
    refused: list[str]
    names: list[str]


@contextmanager
def as_bags(places: Sequence[Path | BagUrl], stand: Stand) -> Iterator[Bags]:
    """The same recordings as bags; raw ones lie in a temporary folder until the context ends.

    Parameters
    ----------
    places
        Bags, their URLs, and files or bags that the channels.yaml of the stand describes.
    stand
        The stand.

    Raises
    ------
    RecordingError
        A raw recording is refused, and nothing else is left.
    """
    with TemporaryDirectory(prefix="flea_raw_") as folder:
        found = Bags([], [], [])
        raw = [place for place in places if isinstance(place, Path) and _is_raw(place, stand)]
        for number, place in enumerate(places, 1):
            if place not in raw:
                found.places.append(place)
                found.names.append(str(place))
                continue
            progress(number, len(places), place.name)
            try:
                made = _imported(place, stand, Path(folder) / str(number))
            except FleaError as error:
                found.refused.append(str(error))
                warn(str(error))
                continue
            found.places.extend(made)
            found.names.extend(str(place if len(made) == 1 else place / each.name) for each in made)
        if found.refused and not found.places:
            raise RecordingError(f"none of {len(found.refused)} recordings can be used")
        yield found


def _is_raw(place: Path, stand: Stand) -> bool:
    if place.name.endswith(FLEA_SUFFIX) or suffix_of(place):
        return True
    if stand.channels is None:
        return False
    try:
        return not is_bag_of_ours(place)
    except FleaError:
        return False  # what it is, the reader of bags says better


def _imported(place: Path, stand: Stand, folder: Path) -> list[Path]:
    from flea_diag.configuration.channels import channel_sources
    from flea_diag.tools.recordings.importer import import_run, write_recording
    from flea_diag.tools.recordings.mapped_source import mapped_recordings

    if place.name.endswith(FLEA_SUFFIX):
        return [Path(import_run(place, folder).bag)]
    found = []
    for recording in list(mapped_recordings(place, channel_sources(stand))):
        for words in recording.warnings:
            warn(words)
        directory = folder / recording.name
        write_recording(recording, directory, stand.name)
        found.append(directory)
    return found
