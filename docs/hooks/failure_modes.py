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

"""The table of docs/failure_modes.md, from the failure modes that the simulator has.

    python docs/hooks/failure_modes.py        renew it

``test/project/test_failure_modes.py`` holds the page against this.
"""

from __future__ import annotations

from pathlib import Path

from flea_sim_driver.failure_modes import FAILURE_MODES

PAGE = Path(__file__).resolve().parents[1] / "failure_modes.md"
BEGIN, END = "<!-- table 1 -->\n", "<!-- /table 1 -->"
HEAD = ("component, failure", "simulated as", "what it does", "found by", "may be named")


def table() -> str:
    """The rows as markdown."""
    rows = (
        (
            f"{mode.component}: {mode.mode}",
            mode.shown,
            mode.effect,
            mode.found,
            ", ".join(mode.group) or "no alarm",
        )
        for mode in FAILURE_MODES
    )
    lines = (HEAD, ("---",) * len(HEAD), *rows)
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def renewed(text: str) -> str:
    """The page with the table between its markers."""
    before, _, rest = text.partition(BEGIN)
    return f"{before}{BEGIN}{table()}{END}{rest.partition(END)[2]}"


if __name__ == "__main__":
    PAGE.write_text(renewed(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
