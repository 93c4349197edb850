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

"""Numbers of which each is within its limit, and their product is not."""

from __future__ import annotations

from pathlib import Path
from random import Random
from typing import Any

import yaml

from support.bombs.bomb import REFUSED, TOLD, Input, flea, rows, several
from support.places import FLEA_STAND, ROOT

NOMINAL = str(ROOT / "bags" / "nominal")
PLANNED = ("runs are planned", "at most", "its limit", "from 1 to", "must", "outside")


def _campaign(folder: Path, *sources: dict[str, Any], configurations: int = 1) -> Input:
    path = folder / "k.yaml"
    names = ["hybrid"] * configurations
    content = {
        "schema_version": 1, "name": "big", "configurations": names, "sources": list(sources)
    }  # fmt: skip
    path.write_text(yaml.safe_dump(content))
    command = flea("evaluate", path, "-o", folder / "out", "-q")
    return Input(command, REFUSED, PLANNED)


def _drawn(chance: Random, least: int = 1_100_000) -> dict[str, Any]:
    rows, cases = several(1, 100, chance), several(1100, 10_000, chance)
    times = max(1000, least // (rows * cases) + 1)
    made = [{"title": f"Jam {k}", "fault": "jam", "cases": cases} for k in range(rows)]
    return {"kind": "drawn", "name": "d", "times": times, "rows": made}


def rows_by_cases_by_times(folder: Path, chance: Random) -> Input:
    return _campaign(folder, _drawn(chance))


def files_by_times(folder: Path, chance: Random) -> Input:
    files = ["jam"] * several(1100, 10_000, chance)
    source = {"kind": "scenarios", "name": "s", "times": 1000, "files": files}
    return _campaign(folder, source)


def a_sum_of_sources(folder: Path, chance: Random) -> Input:
    one = {"title": "Jam", "fault": "jam", "cases": 10_000}
    source = {"kind": "drawn", "times": 60, "rows": [one]}
    many = several(2, 50, chance)
    return _campaign(folder, *({**source, "name": f"d{k}"} for k in range(many)))


def configurations_without_end(folder: Path, chance: Random) -> Input:
    one = {"title": "Jam", "fault": "jam", "cases": 1000}
    source = {"kind": "drawn", "name": "d", "times": 10, "rows": [one]}
    return _campaign(folder, source, configurations=several(101, 9000, chance))


def ladders_by_cases(folder: Path, chance: Random) -> Input:
    source = {
        "kind": "injections", "name": "i", "cases": several(10_000, 10**9, chance), "ladder": True,
        "files": NOMINAL,
    }  # fmt: skip
    return _campaign(folder, source)


def counts_beyond_any(folder: Path, chance: Random) -> Input:
    odd = chance.choice((10**30, -1, 0, 1.5, float("inf"), float("nan"), "many", [1]))
    one = {"title": "Jam", "fault": "jam", "cases": odd}
    return _campaign(folder, {"kind": "drawn", "name": "d", "times": odd, "rows": [one]})


def seeds_without_end(folder: Path, chance: Random) -> Input:
    last = several(1_000_001, 10**18, chance)
    commands = (
        ("features", "study", "--seeds", f"0:{last}"),
        ("features", "learn", "--seeds", f"0:{last}", "-o", folder / "t.yaml"),
        ("features", "train", "--seeds", f"0:{last}", "-o", folder / "c.json"),
    )
    return Input(flea(*chance.choice(commands)), REFUSED, PLANNED)


def a_run_of_years(folder: Path, chance: Random) -> Input:
    duration_s = chance.choice((1e9, 1e15, -1.0, 0.0, float("inf"), float("nan"), 1e-9))
    path = folder / "s.yaml"
    path.write_text(yaml.safe_dump({"duration_s": duration_s}))
    return Input(flea("simulate", path, "-o", folder / "out"), REFUSED, ("duration_s",))


def a_rate_beyond_any(folder: Path, chance: Random) -> Input:
    rate_hz = chance.choice((1e9, 1e15, 0.0, -1.0, float("nan"), 1e-6))
    path = folder / "s.yaml"
    path.write_text(yaml.safe_dump({"sensors": {"vibration_rate_hz": rate_hz}}))
    return Input(flea("simulate", path, "-o", folder / "out"), REFUSED, ("vibration_rate_hz",))


def windows_without_end(folder: Path, chance: Random) -> Input:
    odd = chance.choice((10**9, 10**30, 0, -1, "x"))
    option = chance.choice(("--windows", "--jobs"))
    table = FLEA_STAND / "feature_table.yaml"
    return Input(flea("features", "judge", table, NOMINAL, option, odd), TOLD)


TOTALS = rows(
    "total", rows_by_cases_by_times, files_by_times, a_sum_of_sources, configurations_without_end,
    ladders_by_cases, counts_beyond_any, seeds_without_end, a_run_of_years, a_rate_beyond_any,
    windows_without_end,
)  # fmt: skip
