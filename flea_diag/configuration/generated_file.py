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

"""Generated code as files beside the cache of a start, to be read, profiled and stepped through.

A file is named by the hash of its content. What runs is the text in memory that the hash was taken
of, so nothing that is done to a file changes an answer; a changed one is written anew.
"""

from __future__ import annotations

import re
from contextlib import suppress
from pathlib import Path

from flea_diag.cache_folder import cache_folder
from flea_diag.configuration.disk_cache import prune, write_whole
from flea_diag.core.symbolic.generated import in_memory
from flea_diag.errors import FleaError
from flea_diag.wire.regular_file import read_bytes

FOLDER = "generated"
ENTRY = re.compile(r"[0-9a-f]{64}\.py")


def source_file(digest: str, source: str) -> str:
    """Path of the file that holds a source; a name in memory where none can be written."""
    with suppress(OSError, RuntimeError):  # a user without a home, a full or read-only disk
        place = cache_folder() / FOLDER / f"{digest}.py"
        data = source.encode()
        if not _holds(place, data):
            write_whole(place, data)
            prune(place.parent, ENTRY)
        return str(place)
    return in_memory(digest, source)


def _holds(place: Path, data: bytes) -> bool:
    with suppress(OSError, FleaError):
        return read_bytes(place, len(data)) == data
    return False
