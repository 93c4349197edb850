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

"""The recorder on a disk that answers when it is let: `stalling_recorder.py GATE --ros-args ...`.

While somebody holds the lock of the file GATE the disk takes nothing, and says so in a file
beside it.
"""

from __future__ import annotations

import fcntl
import os
import sys
from pathlib import Path

from flea_diag.nodes.main import main

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
sys.exit(main(["recorder", *sys.argv[1:]]))
