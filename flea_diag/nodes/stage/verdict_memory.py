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

"""The last verdict on disk, from which an isolator or diagnoser restarted during a run resumes.

A restarted node recovers its state from the latched topics of the others; its own end with it.
The verdict contains the group of the open episode, from which the isolator goes on, and the
learned unit offsets: the diagnoser's observer resumes from them, where an isolator alone is told
by the observer. Both hold only where the stamps belong to the same run.
"""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Any

from flea_diag.errors import FleaError, WireError, shown
from flea_diag.nodes.set_aside import set_aside
from flea_diag.nodes.state_folder import state_folder
from flea_diag.wire.bus import Bus
from flea_diag.wire.messages.codec import decode, encode
from flea_diag.wire.records import AmbiguityGroup
from flea_diag.wire.regular_file import read_bytes
from flea_diag.wire.whole_file import replace_file

LARGEST_BYTES = 1 << 20
NONE = "none"


def checked(verdict: AmbiguityGroup) -> AmbiguityGroup:
    """The verdict, if what it has learned of the unit can have been learned.

    Raises
    ------
    WireError
        A zero is no number.
    """
    for offset in verdict.offsets:
        known = math.isfinite(offset.value) and math.isfinite(offset.sigma) and offset.sigma >= 0.0
        if not known:
            raise WireError(
                f"{shown(offset.parameter)} = {offset.value!r} with sigma {offset.sigma!r} is no "
                "zero that a unit can have"
            )
    return verdict


class VerdictMemory:
    """File with the latest verdict; a damaged one is set aside and reported once.

    Parameters
    ----------
    bus
        Bus of the node.
    path
        Path of the file; empty: one file per domain and node name; "none": no file.
    """

    def __init__(self, bus: Bus[Any], path: str) -> None:
        domain = os.environ.get("ROS_DOMAIN_ID") or "0"
        name = f"{domain}_{bus.name.replace('/', '_')}.cdr"
        self._bus = bus
        self._path = Path(path) if path else state_folder() / "verdicts" / name
        self._used = path != NONE

    def recall(self) -> AmbiguityGroup | None:
        """The stored verdict; None when there is no file or it cannot be read."""
        if not self._used:
            return None
        try:
            return checked(decode(AmbiguityGroup, read_bytes(self._path, LARGEST_BYTES)))
        except FileNotFoundError:
            return None
        except (OSError, FleaError) as error:
            self._bus.warn(
                f"memory = {str(self._path)!r} cannot be read ({error}): starting without the "
                f"previous verdict{self._moved()}"
            )
            return None

    def _moved(self) -> str:
        """Where the unreadable file is now; what is no file stays where it is, and unused."""
        self._used = self._path.is_file()
        try:
            return f"; it is kept as {set_aside(self._path).name}" if self._used else ""
        except OSError:
            return ""

    def keep(self, group: AmbiguityGroup) -> None:
        """Replace the stored verdict in one step: a reader sees either the old or the new one."""
        if not self._used:
            return
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            replace_file(self._path, encode(group))
        except OSError as error:
            self._used = False
            self._bus.warn(
                f"memory = {str(self._path)!r} cannot be written ({error}): a restarted node "
                "will begin without the state of this run; name a writable file"
            )
