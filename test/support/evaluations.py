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

"""What the tests of evaluations share: a small campaign on the bags that come with the source."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from threading import Event
from typing import Any

from flea_diag.tools.campaign.campaign import Campaign, campaign_from_mapping
from flea_diag.tools.campaign.case import Case, Recipe
from flea_diag.tools.campaign.run_result import RunResult
from support.decisions import BAGS, NAMES

SHORT: dict[str, Any] = {
    "schema_version": 1,
    "name": "short",
    "sources": [
        {"kind": "recordings", "name": "kept", "files": [str(BAGS / bag) for bag in NAMES]}
    ],
}
"""Six bags of 16 to 22 s."""


def campaign(**changes: Any) -> Campaign:
    """The short campaign with changes."""
    return campaign_from_mapping({**SHORT, **changes}, "short")


def case(name: str, **changes: Any) -> Case:
    """A case of one of the bags."""
    return replace(Case(name, "simulated", name, Recipe(recording=str(BAGS / name))), **changes)


def numbered(count: int) -> list[Case]:
    """Cases that differ by name alone."""
    return [Case(f"n/{k}", "simulated", "row", Recipe()) for k in range(count)]


def name_it(case: Case) -> RunResult:
    """Work that is done at once."""
    return RunResult(case.id, case.kind, case.row, words=str(os.getpid()))


def die_on_seven(case: Case) -> RunResult:
    """Work on which one case takes its process down, as a crash in a library would."""
    if case.id == "n/7":
        os.kill(os.getpid(), signal.SIGKILL)
    return name_it(case)


def say_where_then_wait(case: Case, folder: str) -> RunResult:
    """Work that says in which process it is, and then waits for the file ``go``."""
    (Path(folder) / f"{case.id.replace('/', '_')}.{os.getpid()}").touch()
    until(lambda: (Path(folder) / "go").exists(), "go")
    return name_it(case)


def until(happened: Callable[[], bool], what: str, limit_s: float = 180.0) -> None:
    """Wait for a predicate."""
    end, never = time.monotonic() + limit_s, Event()
    while not happened():
        assert time.monotonic() < end, f"{what}: not within {limit_s:g} s"
        never.wait(0.01)
