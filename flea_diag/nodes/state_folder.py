"""Where nodes keep what has to survive them."""

from __future__ import annotations

import os
from pathlib import Path


def state_folder() -> Path:
    """Folder of the user's state (XDG base directories); it need not exist yet."""
    state = os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state"
    return Path(state) / "flea_diag"
