"""Folder for data that must survive a restart of a node."""

from __future__ import annotations

import os
from pathlib import Path


def state_folder() -> Path:
    """State folder of the user (XDG base directories); it may not exist yet."""
    state = os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state"
    return Path(state) / "flea_diag"
