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

"""One stand of a fleet: its diagnoser, and what is done when that fails."""

from __future__ import annotations

import traceback
from dataclasses import replace
from pathlib import Path
from typing import Any

from flea_diag.errors import FleaError
from flea_diag.nodes.fleet.fleet_parameters import values_of
from flea_diag.nodes.fleet.stand_list import StandEntry
from flea_diag.nodes.stage.inbox import Turns
from flea_diag.nodes.stage_nodes import diagnoser
from flea_diag.wire.bus import Bus
from flea_diag.wire.bus.life_cycle import ACTIVATE, CONFIGURE, DEACTIVATE, INACTIVE
from flea_diag.wire.bus.node_beside import NodeBeside


class FleetStand:
    """The diagnoser of one stand, a managed node of its own.

    What fails in it sets it aside: it is deactivated and cleaned up, and can be configured again
    through its life cycle. The others do not notice.

    Parameters
    ----------
    host
        Bus of the fleet.
    entry
        The stand.
    parameters
        Those of the fleet.
    turns
        Shared by all of its stands.
    """

    def __init__(self, host: Bus[Any], entry: StandEntry, parameters: Any, turns: Turns) -> None:
        self.namespace, self._host = entry.namespace, host
        self.trouble = ""
        """Why it was left out or set aside, the last time that it was."""
        self._failing = False
        prepared = replace(diagnoser(turns), prepare=None)
        self._member = NodeBeside(host, prepared, entry.namespace, values_of(entry, parameters))
        self._member.bus.on_failure = self._failed

    @property
    def running(self) -> bool:
        """Whether it diagnoses."""
        return self._member.bus.working

    @property
    def built(self) -> bool:
        """Whether it waits to be activated."""
        return self._member.bus.state == INACTIVE

    @property
    def words(self) -> str:
        """State in words."""
        if self.running or self.built or not self.trouble:
            return self._member.bus.state
        return self.trouble

    def build(self, refused: Exception | None) -> None:
        """Build the stage, unless its files are refused already."""
        try:
            if refused is not None:
                raise refused
            self._member.managed.change(CONFIGURE)
        except Exception as error:  # whatever is wrong with one stand, the others start
            self.trouble = self._member.managed.reason = _told(error)
            self._host.error(f"stand {self.namespace} is left out: {self.trouble}")

    def activate(self) -> None:
        """Begin to diagnose, if built."""
        if self.built:
            self._change(ACTIVATE)

    def deactivate(self) -> None:
        """Pause; the last verdict is marked stale."""
        if self.running:
            self._change(DEACTIVATE)

    def _change(self, transition: str) -> None:
        try:
            self._member.managed.change(transition)
        except FleaError as error:
            self._failed(error)

    def _failed(self, error: Exception) -> None:
        """Stop at once; what it holds is removed once its callback has returned."""
        if self._failing:
            return
        self._failing = True
        self.trouble = self._member.managed.reason = _told(error)
        self._host.error(f"stand {self.namespace} is set aside: {self.trouble}; the others go on")
        self._member.bus.state = INACTIVE
        self._host.soon(self._set_aside)

    def _set_aside(self) -> None:
        self._member.managed.set_aside()
        self._failing = False

    def close(self) -> None:
        """Destroy the node."""
        self._member.close()


def _told(error: Exception) -> str:
    """An error in one line; of one that is not raised on purpose, also where it was raised."""
    if isinstance(error, FleaError):
        return str(error)
    last = traceback.extract_tb(error.__traceback__)[-1:]
    where = "".join(f" in {Path(each.filename).name}:{each.lineno}" for each in last)
    return f"{type(error).__name__}{where}: {error}"
