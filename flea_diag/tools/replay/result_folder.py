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

"""A folder of results, one JSON file per bag, each written as soon as it is there.

A replay of many bags that was interrupted goes on from them: a result counts where the same files
of the stand, the same method and the same version made it, and the bag is no younger.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flea_diag import __version__
from flea_diag.errors import FleaError
from flea_diag.tools.bag_url import BagUrl
from flea_diag.tools.terminal import make_folder, write_json
from flea_diag.wire.json_text import parse_json
from flea_diag.wire.regular_file import read_text

if TYPE_CHECKING:
    from flea_diag.configuration.stand import Stand

MADE_BY = "made_by"
LARGEST_BYTES = 64 << 20


class ResultFolder:
    """See the module's first line; it is made if it does not exist.

    Parameters
    ----------
    made_by
        Digest of what decides, as of ``made_by``.
    """

    def __init__(self, folder: Path, made_by: str) -> None:
        self._folder, self._made_by = folder, made_by
        make_folder(folder)

    def file_of(self, bag: str) -> Path:
        """Where the result of a bag is, by its name."""
        return self._folder / f"{Path(bag).resolve().name}.json"

    def add(self, summary: dict[str, Any]) -> None:
        """Write the result of a bag.

        Raises
        ------
        ConfigurationError
            It cannot be written.
        """
        write_json(str(self.file_of(summary["bag"])), summary)

    def holds(self, bag: Path | BagUrl) -> bool:
        """Whether the result of a bag is there, made as it would be made now.

        What cannot be read counts as none: the bag is replayed again, and its file replaced.
        """
        file = self.file_of(str(bag))
        try:
            kept = parse_json(read_text(file, LARGEST_BYTES), largest=LARGEST_BYTES)
            older = isinstance(bag, Path) and _changed(bag) > file.stat().st_mtime
        except (OSError, ValueError, FleaError):
            return False
        same = isinstance(kept, dict) and kept.get("bag") == str(bag)
        return same and kept.get(MADE_BY) == self._made_by and not older


def made_by(stand: Stand, method: str, namespace: str | None) -> str:
    """Digest of what decides: version, method and files of the stand, whatever their folder."""
    text = json.dumps([__version__, method, namespace, sorted(stand.texts().items())])
    return hashlib.sha256(text.encode()).hexdigest()


def _changed(bag: Path) -> float:
    """When a file, or the youngest file of a folder, was last changed."""
    files = [bag, *bag.iterdir()] if bag.is_dir() else [bag]
    return max(file.stat().st_mtime for file in files)
