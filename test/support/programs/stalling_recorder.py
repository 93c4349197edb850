"""The recorder on a disk that answers when it is let: `stalling_recorder.py GATE --ros-args ...`.

While somebody holds the lock of the file GATE the disk takes nothing, and says so in a file
beside it.
"""

from __future__ import annotations

import fcntl
import os
import sys
from pathlib import Path

from flea_diag.nodes.recording.recorder import main

GATE = Path(sys.argv.pop(1))
to_disk = os.fdatasync


def stalled(descriptor: int) -> None:
    """Put it on the disk once the gate is open."""
    with GATE.open() as gate:
        try:
            fcntl.flock(gate, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            GATE.with_suffix(".stalls").touch()
            fcntl.flock(gate, fcntl.LOCK_EX)
    to_disk(descriptor)


os.fdatasync = stalled
sys.exit(main())
