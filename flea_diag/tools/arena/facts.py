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

"""What a diagnoser of others is told: the stand, and nominal recordings to learn from."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from flea_diag.api.opening import open_recording
from flea_diag.api.stand import StandFolder
from flea_diag.configuration.stand import Stand
from flea_diag.tools.arena.child import Child
from flea_diag.tools.arena.entrant import Arena, Entrant
from flea_diag.tools.arena.stage import ForeignStage


def foreign_stage(
    entrant: Entrant, arena: Arena, stand: Stand, nominal: Sequence[Path]
) -> ForeignStage:
    """A diagnoser of others, ready for one run.

    Raises
    ------
    DiagnoserError
        It cannot be started, or fails at its start.
    """
    told = facts(stand)
    runs = [_columns(bag) for bag in nominal]
    child = Child(entrant.command, arena.limit_s, arena.memory_mb)
    try:
        return ForeignStage(child, told, runs)
    except BaseException:
        child.close()
        raise


def facts(stand: Stand) -> dict[str, Any]:
    """Name, channels with their units, scan period in s, and faults with their components."""
    known = StandFolder(stand)
    return {
        "name": known.name,
        "channels": known.channels,
        "period_s": known.calibration.period_s,
        "faults": known.faults,
    }


@lru_cache(maxsize=64)
def _columns(bag: Path) -> dict[str, Any]:
    """Columns of a recording as plain lists; None where nothing was measured."""
    table = open_recording(bag).table
    return {
        name: np.where(np.isfinite(values), values, None).tolist()
        for name, values in table.items()
        if np.isfinite(values).any()
    }
