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
