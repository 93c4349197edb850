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

"""Recordings that are no bags of flea_diag: text of the FLEA, tables, bags of other topics."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from flea_diag.api.columns import TIMES, recording_of
from flea_diag.api.recording import Recording, kept
from flea_diag.api.stand_facts import channels_of, files_of, mapping_of
from flea_diag.errors import RecordingError, shown
from flea_diag.tools.recordings.importer import records_of
from flea_diag.tools.recordings.raw_recordings import FLEA_SUFFIX, is_bag_of_ours
from flea_diag.tools.tables.readers import read_table, stem_of, suffix_of
from flea_diag.wire.sources.mapping import MAPPED, SourceMapping

if TYPE_CHECKING:
    from flea_diag.configuration.stand import Stand


def foreign_recording(path: Path, stand: Stand | None, part: str) -> Recording | None:
    """The recording of a file of any make; None where it is a bag of flea_diag.

    Raises
    ------
    RecordingError
        It lacks what the stand names, or nothing says what its columns are.
    """
    if path.name.endswith(FLEA_SUFFIX):
        return _of_the_flea(path, stand)
    mapping = None if stand is None else mapping_of(stand)
    if mapping is not None and mapping.format == MAPPED and not is_bag_of_ours(path):
        assert stand is not None
        return _mapped(path, stand, mapping, part)
    return _named_table(path, stand) if suffix_of(path) else None


def _of_the_flea(path: Path, stand: Stand | None) -> Recording:
    from flea_diag.tools.recordings.flea_data import read_flea_data
    from flea_diag.tools.recordings.flea_run import FleaRun

    run = FleaRun.of(read_flea_data(path))
    return kept(path.name.removesuffix(FLEA_SUFFIX), records_of(run), stand)


def _mapped(path: Path, stand: Stand, mapping: SourceMapping, part: str) -> Recording:
    from flea_diag.tools.recordings.mapped_source import mapped_recordings

    found = {each.name: each for each in mapped_recordings(path, mapping)}
    if not part and len(found) > 1:
        raise RecordingError(
            f"{path} holds {len(found)} recordings: choose one with part={next(iter(found))!r}; "
            f"they are {', '.join(list(found)[:20])}"
        )
    name = part or next(iter(found))
    if name not in found:
        raise RecordingError(f"{path} has no part {shown(name)}, it has {', '.join(found)}")
    return kept(name, records_of(found[name]), stand)


def _named_table(path: Path, stand: Stand | None) -> Recording:
    """A table whose columns are called as the channels are, such as ``flea export`` writes."""
    columns = read_table(path).columns
    if not any(name in columns for name in TIMES):
        raise RecordingError(
            f"{path} has no column {' or '.join(TIMES)}, so its columns are not known: write a "
            f"stand with flea stand new ./mine --from {path} and open it with stand='./mine'"
        )
    known = files_of(stand)
    names = (*TIMES, *channels_of(known))
    named = {name: values for name, values in columns.items() if name in names}
    read = {name: values for name, values in named.items() if np.isfinite(values).any()}
    made = recording_of(read, known, name=stem_of(path))
    return kept(made.name, made.records((object,)), known if stand is not None else None)
