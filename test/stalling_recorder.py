"""The recorder on a disk that answers when it is let: `stalling_recorder.py GATE --ros-args ...`.

While the file GATE is there the disk takes nothing, and says so in a file beside it.
"""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

from flea_diag.nodes.recorder import main

GATE = Path(sys.argv.pop(1))
to_disk = os.fdatasync


def stalled(descriptor: int) -> None:
    """Put it on the disk once the gate is open."""
    if GATE.exists():
        GATE.with_suffix(".stalls").touch()
    while GATE.exists():
        time.sleep(0.01)
    to_disk(descriptor)


os.fdatasync = stalled
sys.exit(main())
