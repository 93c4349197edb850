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

"""A node that speaks the topics takes part in the arena, in a domain of its own."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from support.live import environment
from support.places import ROOT

from flea_diag.errors import DiagnoserError
from flea_diag.tools.arena.child import Child
from flea_diag.tools.arena.entrant import entrant
from flea_diag.tools.arena.stage import ForeignStage
from flea_diag.wire.records import AmbiguityGroup, Outcome, Scan

NODE = Path(ROOT) / "test" / "support" / "programs" / "jam_node.py"
TOLD = {"name": "s", "channels": {"motor_current": "A"}, "period_s": 0.01, "faults": {"jam": ""}}
LIMIT_S, MEMORY_MB = 120.0, 2048


def child(domain: int, monkeypatch: pytest.MonkeyPatch, *more: str) -> Child:
    """The bridge with the node behind it; the domain of the test keeps others out of the way."""
    monkeypatch.setenv("PYTHONPATH", environment(domain)["PYTHONPATH"])
    text = f"node:{sys.executable} {NODE} {' '.join(more)}"
    return Child(entrant(text).command, LIMIT_S, MEMORY_MB)


def answers(process: Child, values: list[float]) -> list[AmbiguityGroup]:
    """What the node says to these currents, one a scan."""
    try:
        stage = ForeignStage(process, TOLD)
        said = []
        for k, value in enumerate(values):
            said += stage.handle(Scan(k * 10**7, ("motor_current",), (value,)))
        said += stage.finish()
        return [record for record in said if isinstance(record, AmbiguityGroup)]
    finally:
        process.close()


def test_a_node_of_somebody_else_is_asked(domain: int, monkeypatch: pytest.MonkeyPatch) -> None:
    groups = answers(child(domain, monkeypatch), [1.0] * 200 + [6.0] * 200)
    assert [(g.outcome, [m.fault for m in g.members]) for g in groups] == [
        (Outcome.NOMINAL, []),
        (Outcome.ISOLATED, ["jam"]),
    ]
    assert groups[-1].stamp_ns >= 200 * 10**7


def test_a_node_that_ends_is_a_failure(domain: int, monkeypatch: pytest.MonkeyPatch) -> None:
    process = child(domain, monkeypatch, "--end")
    with pytest.raises(DiagnoserError, match=r"no subscription to sensors/slow|node ended"):
        answers(process, [1.0] * 400)
