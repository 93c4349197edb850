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

"""What of a diagnosis two runs must agree on, and where the expected ones are kept."""

from __future__ import annotations

import json
from typing import Any

from support.places import ROOT

BAGS = ROOT / "bags"
EXPECTED = ROOT / "test" / "expected_decisions"
NAMES = sorted(path.stem for path in EXPECTED.glob("*.json"))
"""Bags that come with the source; beside them lies what users record."""

DECIDED = (
    "outcome",
    "detected_at_s",
    "isolated_at_s",
    "ambiguity_group",
    "not_observable",
    "features_computed",
)
OF_AN_EPISODE = ("episode", "outcome", "detected_at_s", "isolated_at_s", "ambiguity_group")


def decisions(summary: dict[str, Any]) -> dict[str, Any]:
    """Decisions in a summary of ``flea replay``: equal everywhere, with no tolerance."""
    episodes = [{key: each[key] for key in OF_AN_EPISODE} for each in summary["episodes"]]
    return {**{key: summary[key] for key in DECIDED}, "episodes": episodes}


def write_expected(name: str, summary: dict[str, Any]) -> None:
    """Expect of this bag what the summary says; the digest holds for its backend alone."""
    expected = {
        **decisions(summary),
        "backend": summary["backend"],
        "decision_digest": summary["decision_digest"],
    }
    text = json.dumps(expected, indent=2, allow_nan=False) + "\n"
    (EXPECTED / f"{name}.json").write_text(text, encoding="utf-8")


def expected(name: str) -> dict[str, Any]:
    """What is expected of a bag."""
    found: dict[str, Any] = json.loads((EXPECTED / f"{name}.json").read_text(encoding="utf-8"))
    return found
