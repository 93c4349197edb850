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

"""Where a figure comes from: the day and the commit that it was measured on."""

from __future__ import annotations

import subprocess
from datetime import datetime, timezone
from functools import cache
from pathlib import Path

from flea_diag import __version__

ROOT = Path(__file__).resolve().parents[2]
NOTE = "flea_diag/commit.txt"
"""Written when the package is built from a repository."""
LIMIT_S = 10.0


def today() -> str:
    """Date in UTC, as ``2026-11-22``."""
    return datetime.now(timezone.utc).strftime("%Y-%m-%d")


@cache
def commit(root: Path = ROOT) -> str:
    """Commit of the source, with ``+`` where files differ from it; else ``version 0.1.0``.

    That of the repository whose root this is, or the one that the installed package was built
    from. An environment that lies inside another repository does not count.
    """
    note = root / NOTE
    if (root / ".git").exists():
        found = _described(root)
    else:
        found = note.read_text(encoding="utf-8").strip() if note.is_file() else ""
    return found or f"version {__version__}"


def _described(root: Path) -> str:
    """What git says, empty where there is no git."""
    command = ["git", "-C", str(root)]
    command += ["describe", "--always", "--dirty=+", "--abbrev=9", "--exclude=*"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT_S, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout.strip()
