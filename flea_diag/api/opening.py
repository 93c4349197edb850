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

"""``fd.open``: a bag, a recording of any make or a URL, as one kind of object."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from flea_diag.api.foreign_recording import foreign_recording
from flea_diag.api.recording import SENT, Recording, kept, of_bag
from flea_diag.api.stand_facts import files_of
from flea_diag.tools.bag_url import BagUrl, bag_place, local
from flea_diag.wire.regular_file import missing


def open_recording(
    path: str | Path,
    stand: Any = None,
    *,
    part: str = "",
    namespace: str | None = None,
) -> Recording:
    """Open a recording, whatever it is.

    Parameters
    ----------
    path
        A bag of flea_diag (folder or .mcap file); a text file of the FLEA (``.data``); a table
        (CSV, NPZ, Parquet) or a bag with topics of its own, by the ``channels.yaml`` of ``stand``;
        a table whose columns are named after channels, beside ``time_s``; or a URL of a bag.
    stand
        ``fd.Stand``, the name of a shipped one, or a folder as a path (``./mine``).
    part
        Name of one recording, where the stand splits a table into several.
    namespace
        Namespace of the stand, where a bag holds several.

    Returns
    -------
    Recording
        Channels in SI units (temperatures in degC), times in seconds.

    Raises
    ------
    RecordingError
        The file does not exist, is damaged, or lacks what the stand's channels.yaml names.
    ConfigurationError
        There is no such stand, or the packages for a URL or Parquet are not installed.
    """
    known = None if stand is None else files_of(stand)
    place = bag_place(str(path))
    if isinstance(place, BagUrl):
        with local(place) as copy:
            return kept(place.name, of_bag(copy, known, namespace).records(SENT), known)
    if not place.exists():
        raise missing(place)
    found = foreign_recording(place, known, part)
    return found if found is not None else of_bag(place, known, namespace)


def opened(run: Recording | str | Path, stand: Any = None) -> Recording:
    """A recording, opened with the stand where it is a path."""
    return run if isinstance(run, Recording) else open_recording(run, stand)
