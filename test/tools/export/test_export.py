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

"""Exports are read back by others' readers, and by ours, to the same diagnosis."""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from support.decisions import BAGS

import flea_diag as fd
from flea_diag.tools.main import main
from flea_diag.wire.bags.bag import BagReader
from flea_diag.wire.records import AmbiguityGroup, Residual

BAG = str(BAGS / "winding_short")


def test_channels_as_csv_give_the_same_diagnosis(tmp_path: Path) -> None:
    target = tmp_path / "run.csv"
    assert main(["export", BAG, "-o", str(target)]) == 0
    assert main(["export", BAG, "-o", str(target)]) == 2
    assert main(["export", BAG, "-o", str(target), "--force"]) == 0
    with target.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    values = fd.open(BAG).table["motor_current"]
    assert [float(row["motor_current"]) for row in rows] == values.tolist()
    assert [row.fault for row in fd.diagnose(target).group] == ["winding_short"]


def test_residuals_as_parquet_are_those_of_the_diagnosis(tmp_path: Path) -> None:
    target = tmp_path / "residuals.parquet"
    assert main(["export", BAG, "-o", str(target), "--what", "residuals"]) == 0
    frame, told = pd.read_parquet(target), fd.diagnose(BAG).residuals
    np.testing.assert_array_equal(frame["parity_mechanical/z"], told["parity_mechanical/z"])


@pytest.mark.parametrize("what", ["verdicts", "evidence"])
def test_words_as_csv_and_the_report_as_json(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], what: str
) -> None:
    target = tmp_path / f"{what}.csv"
    assert main(["export", BAG, "-o", str(target), "--what", what, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    with target.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert told["rows"] == len(rows)
    assert "winding_short" in {row.get("members", row.get("fault")) for row in rows}


def test_a_bag_of_the_diagnosis_holds_what_the_nodes_publish(tmp_path: Path) -> None:
    target = tmp_path / "diagnosed"
    assert main(["export", BAG, "-o", str(target), "--what", "diagnosis"]) == 0
    records = [record for _, record in BagReader(target).records((AmbiguityGroup, Residual))]
    last = [record for record in records if isinstance(record, AmbiguityGroup)][-1]
    assert [member.fault for member in last.members] == ["winding_short"]
    assert sum(isinstance(record, Residual) for record in records) > 2000
    assert fd.diagnose(target, residuals=False).digest == fd.diagnose(BAG, residuals=False).digest


def test_a_scenario_of_the_competitions(tmp_path: Path) -> None:
    """Read back by the pattern of the competition's own evaluation script."""
    target = tmp_path / "run.scn"
    assert main(["export", BAG, "-o", str(target)]) == 0
    lines = target.read_text(encoding="utf-8").splitlines()
    faults = [line for line in lines if line.startswith("faultInjection")]
    assert [re.search(r"fault\s*=\s*\{([^}]*)\}", line)[1].strip() for line in faults] == [  # type: ignore[index]
        "winding_short = faulty"
    ]
    assert faults[0].startswith("faultInjection @8000 isInjection = true, ")
    sensors = [line for line in lines if line.startswith("sensors")]
    first = re.fullmatch(r"sensors @0 \{ (.*) \};", sensors[0])
    assert first is not None
    read = dict(pair.split(" = ") for pair in first[1].split(", "))
    assert float(read["motor_current"]) == fd.open(BAG).table["motor_current"][0]
    assert lines.index(faults[0]) == 800


def test_a_scenario_of_the_competitions_tells_the_diagnosis_too(tmp_path: Path) -> None:
    """Times, signals and weights are those of the verdicts; a scorer finds them by pattern."""
    target = tmp_path / "run.scn"
    assert main(["export", BAG, "-o", str(target), "--what", "diagnosis"]) == 0
    lines = target.read_text(encoding="utf-8").splitlines()
    message = re.compile(
        r"diagnosis @(\d+) detectionSignal = (true|false), isolationSignal = (true|false), "
        r'candidates = \{ (.*)\}, notes = "[^"]*";'
    )
    said = [found for line in lines if (found := message.fullmatch(line))]
    assert said[0].group(2, 3, 4) == ("false", "false", "")
    result = fd.diagnose(BAG, residuals=False)
    first = next(found for found in said if found[2] == "true")
    assert int(first[1]) == round(
        1e3 * result.verdicts["time_s"][result.verdicts["episode"] > 0][0]
    )
    last = said[-1]
    assert last[3] == "true"
    weights = dict(re.findall(r"weight = (\S+), faults = \{ (\w+) = faulty \}", last[4]))
    assert {v: float(k) for k, v in weights.items()} == {
        row.fault: row.probability for row in result.group
    }
    stamps = [int(re.search(r"@(\d+)", line)[1]) for line in lines]  # type: ignore[index]
    assert stamps == sorted(stamps)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["x.csv", "--what", "diagnosis"], "are records of many kinds, 'x.csv' holds a table"),
        (["bag", "--what", "residuals"], "is a table: name .*bag.csv or .*bag.parquet"),
        (["x.xls"], "'.xls' is no format of a table: name it .csv"),
    ],
)
def test_what_fits_no_format_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], words: str
) -> None:
    name, *rest = arguments
    assert main(["export", BAG, "-o", str(tmp_path / name), *rest]) == 2
    assert re.search(words, capsys.readouterr().err)
