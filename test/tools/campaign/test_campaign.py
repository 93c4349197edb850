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

"""A campaign file is read as it says, and refused by name where it says something else."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from flea_diag.errors import ConfigurationError
from flea_diag.tools.campaign.campaign import (
    Drawn,
    Injections,
    Recordings,
    campaign_from_mapping,
    load_campaign,
)

ROW = {"title": "Jam", "fault": "jam", "cases": 3, "low": 0.5, "high": 1.5, "switched": True}
DRAWN = {"kind": "drawn", "name": "a", "seed": 7, "rows": [ROW, {"cases": 2}]}
CAMPAIGN: dict[str, Any] = {"schema_version": 1, "name": "two", "sources": [DRAWN]}


def test_a_file_is_read(tmp_path: Path) -> None:
    path = tmp_path / "c.yaml"
    path.write_text(
        "schema_version: 1\n"
        "name: real\n"
        "calibration: halves\n"
        "expect: {jam: [jam, ball_nut_friction], spall: []}\n"
        "sources:\n"
        "- {kind: recordings, files: flea/*.data}\n"
        "- kind: injections\n"
        "  files: [flea/*_Nominal_Low.data]\n"
        "  rows:\n"
        "  - motor_current bias\n",
        encoding="utf-8",
    )
    campaign = load_campaign(path)
    recordings, injections = campaign.sources
    assert recordings == Recordings(files=("flea/*.data",))
    assert isinstance(injections, Injections)
    assert injections.rows == ("motor_current bias",)
    assert campaign.folder == tmp_path
    assert campaign.expected("jam") == ("jam", "ball_nut_friction")
    assert campaign.expected("spall") == ()
    assert campaign.expected("nominal") == ()
    assert campaign.expected("supply_open") == ("supply_open",)


def test_rows_are_named_and_counted() -> None:
    (drawn,) = campaign_from_mapping(CAMPAIGN, "x").sources
    assert isinstance(drawn, Drawn)
    assert [row.title for row in drawn.rows] == ["Jam", "Nominal"]
    assert [row.cases for row in drawn.rows] == [3, 2]


def test_a_folder_is_a_campaign(tmp_path: Path) -> None:
    campaign = load_campaign(tmp_path)
    assert campaign.sources == (Recordings(tmp_path.name, (str(tmp_path),)),)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"colour": "red"}, "unknown parameter 'colour'"),
        ({"schema_version": 2}, "schema_version = 2"),
        ({"sources": []}, "sources must be a list of 1 to 10000"),
        ({"sources": [{"kind": "films"}]}, "kind = 'films' is unknown"),
        ({"sources": [DRAWN, DRAWN]}, "two sources are named 'a'"),
        ({"sources": [{**DRAWN, "times": 5000}]}, "times = 5000 is above its limit 1000"),
        ({"sources": [{**DRAWN, "rows": [{"cases": 10**6}]}]}, "cases = 1000000 is above"),
        ({"sources": [{**DRAWN, "rows": [{"low": 2.0, "high": 1.0}]}]}, "below low = 2.0"),
        ({"sources": [{**DRAWN, "rows": [{"sizes": "much"}]}]}, "sizes = 'much' must be a list"),
        (
            {"sources": [{**DRAWN, "spread": {"x": "wide"}}]},
            "spread: x = 'wide' must",
        ),
        ({"sources": [{"kind": "recordings", "files": [3]}]}, "files[0] = 3 must be text"),
        ({"expect": {"jam": 3}}, "expect: jam = 3 must be a list"),
        ({"limit_percent": 120.0}, "limit_percent = 120.0 is above"),
        ({"name": "../../etc"}, "name = '../../etc' names no folder"),
        ({"sources": [{**DRAWN, "name": ".."}]}, "name = '..' names no folder"),
        ({"name": "a" * 101}, "1 to 100 characters"),
    ],
)
def test_what_is_wrong_is_named(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(ConfigurationError, match=words.replace("[", r"\[")):
        campaign_from_mapping({**CAMPAIGN, **changes}, "c.yaml")
