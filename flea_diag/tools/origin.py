"""Where a figure comes from: the day and the commit that it was measured on."""

from __future__ import annotations

import subprocess
from datetime import datetime, timezone
from functools import cache
from pathlib import Path

from flea_diag import __version__

ROOT = Path(__file__).resolve().parents[2]
LIMIT_S = 10.0


def today() -> str:
    """Date in UTC, as ``2026-11-22``."""
    return datetime.now(timezone.utc).strftime("%Y-%m-%d")


@cache
def commit(root: Path = ROOT) -> str:
    """Commit of the source, ``+`` where files differ from it; else ``version 0.1.0``.

    An installed package has no commit, not even where its environment lies inside a repository.
    """
    top = _git(root, "rev-parse", "--show-toplevel")
    if not top or Path(top).resolve() != root.resolve():
        return f"version {__version__}"
    return _git(root, "describe", "--always", "--dirty=+", "--abbrev=9", "--exclude=*")


def _git(root: Path, *arguments: str) -> str:
    """What git prints, empty where there is no git or no repository."""
    command = ["git", "-C", str(root), *arguments]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT_S, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""
