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

"""Files and bags of any make as recordings, by the mapping of their stand."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from flea_diag.tools.recordings.mapped_bag import of_bag
from flea_diag.tools.recordings.mapped_recording import MappedRecording
from flea_diag.tools.recordings.mapped_table import of_table
from flea_diag.tools.tables.readers import suffix_of
from flea_diag.wire.sources.mapping import SourceMapping


def mapped_recordings(path: Path, mapping: SourceMapping) -> Iterator[MappedRecording]:
    """Recordings of a file or bag: of a table as many as it is split into.

    Raises
    ------
    RecordingError
        It lacks what the mapping names, or what it holds contradicts the mapping.
    """
    yield from of_table(path, mapping) if suffix_of(path) else of_bag(path, mapping)
