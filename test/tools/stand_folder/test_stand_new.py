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

"""``flea stand new``: the folder that it writes is a stand, what it prints and what it refuses."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from support.decisions import BAGS
from support.foreign.recordings_of_others import Sent, csv
from support.places import FLEA

from flea_diag.configuration.channels import channel_sources
from flea_diag.configuration.description import described, faults_of
from flea_diag.configuration.knowledge import load_features
from flea_diag.configuration.stand import load_stand
from flea_diag.tools.main import main
from flea_diag.tools.stand_folder.folder_files import template_texts
from flea_diag.tools.stand_folder.template import template, template_files

SENT = (
    Sent("actuator_position", "position", "mm"),
    Sent("motor_current", "current"),
    Sent("load_force", "force"),
)


@pytest.mark.parametrize("name", template_files())
def test_a_template_is_a_shipped_stand_and_needs_channels_of_it(name: str, tmp_path: Path) -> None:
    found = template(name)
    assert set(found.needs) <= set(found.units)
    # How noisy the slope of its position is belongs to a stand, not to its kind.
    description = tmp_path / "actuator.yaml"
    texts = template_texts(found, tmp_path, "run.csv", None)
    description.write_text(texts["actuator.yaml"], encoding="utf-8")
    assert described(description).smoothing_s == 0.3


def test_a_bag_of_ours_becomes_a_stand_of_its_own_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "mine"
    assert main(["stand", "new", str(folder), "--from", str(BAGS / "nominal")]) == 0
    page = capsys.readouterr().out
    stand = load_stand(folder)
    assert (stand.name, described(stand.actuator).name) == ("mine", "mine")
    assert faults_of(stand.actuator, stand.faults)
    assert load_features(stand.features).features
    found = channel_sources(stand)
    assert found.rate_hz == 100.0
    assert {row.written for row in found.channels} == {"A", "V", "m", "rad/s", "N", "degC"}
    assert len(page.splitlines()) < 30
    # The lead of the simulated FLEA is 3.175 mm; see config/machines/flea.yaml.
    (lead,) = re.findall(r"seen: ([\d.]+) mm for one turn of the motor", page)
    assert float(lead) == pytest.approx(3.175, rel=2e-3)
    assert f"flea import --stand {folder} {BAGS / 'nominal'} -o bags" in page


def test_every_line_that_is_a_guess_says_so(tmp_path: Path) -> None:
    recording = csv(tmp_path / "run.csv", SENT)
    assert main(["stand", "new", str(tmp_path / "mine"), "--from", str(recording)]) == 0
    lines = (tmp_path / "mine" / "channels.yaml").read_text(encoding="utf-8").splitlines()
    told = [line for line in lines if line.strip() and not line.lstrip().startswith("#")]
    headings = ("schema_version", "channels:", *(f"  {each.channel}:" for each in SENT))
    for line in told:
        assert line.startswith(headings) or "# guessed, because " in line, line


def test_a_commanded_load_stands_for_the_load_that_nothing_measures(tmp_path: Path) -> None:
    """The description of a screw has its balance at the load cell."""
    sent = (*SENT[:2], Sent("load_force", "load_command_lbf", "lbf"))
    recording = csv(tmp_path / "run.csv", sent)
    assert main(["stand", "new", str(tmp_path / "mine"), "--from", str(recording)]) == 0
    text = (tmp_path / "mine" / "channels.yaml").read_text(encoding="utf-8")
    (words,) = re.findall(r"  load_force:.*\n    column: load_command_lbf  # (.*)", text)
    assert words == "guessed, because no load is measured, so the command stands for it; check"
    assert "commanded_load" not in text


def test_the_text_format_of_the_flea_is_known(tmp_path: Path) -> None:
    if not FLEA.is_dir():
        pytest.skip(f"no recordings in {FLEA}")
    recording = sorted(FLEA.glob("*_Nominal_*.data"))[0]
    assert main(["stand", "new", str(tmp_path / "mine"), "--from", str(recording)]) == 0
    assert channel_sources(load_stand(tmp_path / "mine")).format == "flea_text"


def nothing_moves(folder: Path) -> Path:
    np.savetxt(folder / "run.csv", np.ones((50, 3)), delimiter=",", header="time,current,position",
               comments="")  # fmt: skip
    return folder / "run.csv"


def of_noise(folder: Path) -> Path:
    time = 0.01 * np.arange(600)[:, None]
    rows = np.hstack([time, np.random.default_rng(2).normal(size=(600, 3))])
    np.savetxt(folder / "run.csv", rows, delimiter=",", header="time,a0,a1,a2", comments="")
    return folder / "run.csv"


def without_times(folder: Path) -> Path:
    rows = np.random.default_rng(1).normal(size=(50, 2))
    np.savetxt(folder / "run.csv", rows, delimiter=",", header="current,position", comments="")
    return folder / "run.csv"


def full(folder: Path) -> Path:
    (folder / "mine").mkdir()
    (folder / "mine" / "kept.txt").write_text("kept", encoding="utf-8")
    return csv(folder / "run.csv", SENT)


REFUSED = {
    full: ("mine exists and is not empty: name a new folder", ()),
    of_noise: ("no motor_current and no actuator_position for dc_screw among a0, a1, a2", ()),
    without_times: ("no column holds times, it has current, position: give the rate, --rate", ()),
    nothing_moves: ("'time' is 1 in all 50 rows: the clock stood still", ()),
    lambda folder: csv(folder / "run.csv", SENT): (
        "template 'rocket' is not shipped, known are dc_screw, ", ("--template", "rocket"),
    ),
    lambda folder: folder / "none.csv": ("none.csv: No such file", ()),
}  # fmt: skip


@pytest.mark.parametrize("make", REFUSED)
def test_what_it_refuses_it_refuses_in_one_line_and_writes_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], make: object
) -> None:
    words, options = REFUSED[make]  # type: ignore[index]
    recording = make(tmp_path)  # type: ignore[operator]
    before = set((tmp_path / "mine").glob("*"))
    given = ["stand", "new", str(tmp_path / "mine"), "--from", str(recording), *options]
    assert main(given) == 2
    errors = capsys.readouterr().err
    assert errors.startswith("flea: ")
    assert words in errors
    assert errors.count("\n") == 1
    assert set((tmp_path / "mine").glob("*")) == before
