"""The last verdict on disk: what a diagnoser that is started again in mid-run takes over.

Separate nodes tell one another what was: the latched topics of those that live on. One process
that dies takes all of it along. What it learned of the unit, and whether a fault was there, stands
in its verdict; the observer takes that over where the stamps say that it is of the same run.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from flea_diag.errors import FleaError
from flea_diag.nodes.state_folder import state_folder
from flea_diag.wire.bus import Bus
from flea_diag.wire.messages.codec import decode, encode
from flea_diag.wire.records import AmbiguityGroup
from flea_diag.wire.whole_file import replace_file

LARGEST_BYTES = 1 << 20
NONE = "none"


class VerdictMemory:
    """One file with the newest verdict; a file that cannot be used is said once, and no more.

    Parameters
    ----------
    bus
        Of the node that it belongs to.
    path
        Of the file; empty is one for this domain and node name, "none" none at all.
    """

    def __init__(self, bus: Bus[Any], path: str) -> None:
        domain = os.environ.get("ROS_DOMAIN_ID") or "0"
        name = f"{domain}_{bus.name.replace('/', '_')}.cdr"
        self._bus = bus
        self._path = Path(path) if path else state_folder() / "verdicts" / name
        self._used = path != NONE

    def recall(self) -> AmbiguityGroup | None:
        """What was kept, None where that is nothing that can be read."""
        if not self._used:
            return None
        try:
            with self._path.open("rb") as file:
                return decode(AmbiguityGroup, file.read(LARGEST_BYTES))
        except FileNotFoundError:
            return None
        except (OSError, FleaError) as error:
            self._bus.warn(f"memory = {str(self._path)!r} tells nothing of the past: {error}")
            return None

    def keep(self, group: AmbiguityGroup) -> None:
        """Put this verdict in place of the last one: a reader sees the one or the other."""
        if not self._used:
            return
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            replace_file(self._path, encode(group))
        except OSError as error:
            self._used = False
            self._bus.warn(
                f"memory = {str(self._path)!r} cannot be written ({error}): a diagnoser that is "
                "started again will know nothing of this run"
            )
