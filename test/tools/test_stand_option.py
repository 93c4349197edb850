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

"""``--stand`` and ``--calibration``, through the commands that take them."""

from __future__ import annotations

import hashlib
import json
import shutil
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import yaml
from support.places import CONFIG, FLEA_STAND, ROOT, SHIPPED_STANDS

from flea_diag.configuration.component import make_pipeline
from flea_diag.configuration.stand import load_stand
from flea_diag.tools.main import main
from flea_diag.tools.replay.replay import replay

BAG = ROOT / "bags" / "nominal"
CALIBRATION = "calibration_simulated_stand.yaml"


BY = pytest.mark.parametrize("configuration", ["hybrid", "evidence"])


@cache
def digest(configuration: str = "hybrid") -> str:
    """Of the bag on the shipped stand."""
    pipeline = make_pipeline(load_stand(), configuration=configuration)
    return str(replay(BAG, pipeline)["digest"])


def replayed(folder: Path, *options: str) -> str:
    """Digest that the command writes with these options."""
    target = folder / "replayed.json"
    assert main(["replay", str(BAG), "-q", "--json", str(target), *options]) == 0
    return str(json.loads(target.read_text(encoding="utf-8"))["digest"])


def refused(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """The one line of a refusal."""
    capsys.readouterr()
    assert main(list(arguments)) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.count("\n") == 1
    return said.err


@pytest.fixture
def mine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the shipped stand under another name, in the working directory."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(FLEA_STAND, tmp_path / "mine")
    edit(tmp_path / "mine" / "stand.yaml", name="mine")
    return tmp_path / "mine"


def edit(path: Path, **changes: Any) -> None:
    """Write a YAML file anew, without its comments, with some entries of the top level changed."""
    content = yaml.safe_load(path.read_text(encoding="utf-8"))
    path.write_text(yaml.safe_dump({**content, **changes}, sort_keys=True), encoding="utf-8")


def content_sha256(path: Path) -> str:
    """SHA-256 of the entries of a YAML file but its version, as canonical JSON."""
    content = yaml.safe_load(path.read_text(encoding="utf-8"))
    del content["schema_version"]
    text = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


# --- which stand ------------------------------------------------------------------------------


def test_a_file_of_the_working_directory_replaces_no_shipped_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for path in [*CONFIG.rglob("*.yaml")]:
        (tmp_path / path.name).write_text("rubbish", encoding="utf-8")
    (tmp_path / "flea").mkdir()
    monkeypatch.chdir(tmp_path)
    assert replayed(tmp_path) == digest()
    assert replayed(tmp_path, "--stand", "flea") == digest()


def test_a_stand_of_your_own_is_a_path(mine: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert replayed(mine.parent, "--stand", "./mine") == digest()
    said = refused(capsys, "replay", str(BAG), "--stand", "mine")
    assert said == (
        f"flea: stand 'mine' is not shipped, known are {', '.join(SHIPPED_STANDS)}; "
        "the folder here is ./mine\n"
    )


def test_a_calibration_that_you_name_is_that_of_the_working_directory(
    mine: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (mine / CALIBRATION).rename(mine.parent / "my.yaml")
    assert replayed(mine.parent, "--stand", "./mine", "--calibration", "my.yaml") == digest()
    said = refused(capsys, "replay", str(BAG), "--stand", "./mine")
    assert f"mine/{CALIBRATION}: no such calibration: make it with flea calibrate " in said
    said = refused(capsys, "replay", str(BAG), "--calibration", "none.yaml")
    assert f"{mine.parent}/none.yaml: no such calibration: make it with flea calibrate " in said
    (mine.parent / CALIBRATION).write_text("rubbish", encoding="utf-8")
    said = refused(capsys, "replay", str(BAG), "--calibration", CALIBRATION)
    assert "calibration must be a mapping, not a text" in said


def test_a_model_is_that_of_the_stand(mine: Path, capsys: pytest.CaptureFixture[str]) -> None:
    edit(mine / "actuator.yaml", name="other", description="another drive")
    assert main(["model", "show", "--stand", "./mine"]) == 0
    assert capsys.readouterr().out.startswith("other: another drive\n")
    assert main(["model", "show"]) == 0
    assert capsys.readouterr().out.startswith("flea: ")


def test_seeds_given_as_a_stand_are_refused_with_the_option_for_them(
    capsys: pytest.CaptureFixture[str],
) -> None:
    said = refused(capsys, "features", "learn", "--stand", "0:20", "-o", "t.yaml")
    assert "--stand = '0:20' is no stand; seeds of simulated runs are given by --seeds" in said


# --- a calibration and its description ----------------------------------------------------------


def test_the_shipped_calibration_names_the_shipped_description() -> None:
    """A change of the description needs another calibration: CONTRIBUTING.md says how."""
    learned = yaml.safe_load((FLEA_STAND / CALIBRATION).read_text(encoding="utf-8"))
    assert learned["actuator"] == "flea"
    assert learned["actuator_sha256"] == content_sha256(FLEA_STAND / "actuator.yaml")


@pytest.mark.in_turn(2)
@BY
def test_another_layout_is_the_same_description(mine: Path, configuration: str) -> None:
    before = (mine / "actuator.yaml").read_text(encoding="utf-8")
    edit(mine / "actuator.yaml")
    assert (mine / "actuator.yaml").read_text(encoding="utf-8") != before
    given = ("--stand", "./mine", "--configuration", configuration)
    assert replayed(mine.parent, *given) == digest(configuration)


def test_a_calibration_of_another_description_is_refused(
    mine: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    flea = content_sha256(FLEA_STAND / "actuator.yaml")[:12]
    edit(mine / "actuator.yaml", description="with a longer screw")
    other = content_sha256(mine / "actuator.yaml")[:12]
    assert other != flea
    expected = (
        f"flea: {mine}/{CALIBRATION}: made for actuator 'flea' (sha256 {flea}), "
        f"{mine}/actuator.yaml describes 'flea' (sha256 {other}): "
        f"give stand flea, or calibrate again with flea calibrate --stand {mine}\n"
    )
    assert refused(capsys, "replay", str(BAG), "--stand", "./mine") == expected
    view = ("model", "equations", "--stand", "./mine", "--calibration", f"mine/{CALIBRATION}")
    assert f"mine/{CALIBRATION}: made for actuator 'flea' (sha256 {flea})" in refused(capsys, *view)


@pytest.mark.in_turn(2)
@BY
def test_a_calibration_from_before_is_known_by_the_name_of_its_actuator(
    mine: Path, capsys: pytest.CaptureFixture[str], configuration: str
) -> None:
    given = ("--stand", "./mine", "--configuration", configuration)
    learned = yaml.safe_load((mine / CALIBRATION).read_text(encoding="utf-8"))
    del learned["actuator_sha256"]
    (mine / CALIBRATION).write_text(yaml.safe_dump(learned, sort_keys=False), encoding="utf-8")
    edit(mine / "actuator.yaml", description="with a longer screw")
    assert replayed(mine.parent, *given) == digest(configuration)
    edit(mine / "actuator.yaml", name="other")
    said = refused(capsys, "replay", str(BAG), *given)
    assert "made for actuator 'flea', " in said
    assert "describes 'other' (sha256 " in said


@pytest.mark.parametrize("wrong", ["12ab", "g" * 64, 5])
def test_a_digest_that_is_none_is_refused(
    mine: Path, capsys: pytest.CaptureFixture[str], wrong: object
) -> None:
    edit(mine / CALIBRATION, actuator_sha256=wrong)
    said = refused(capsys, "replay", str(BAG), "--stand", "./mine")
    assert f"{CALIBRATION}: actuator_sha256 = " in said


# --- campaigns --------------------------------------------------------------------------------


def campaign(folder: Path, **changes: str) -> str:
    """A campaign of one run."""
    sources = [{"kind": "recordings", "name": "one", "files": str(BAG)}]
    content = {"schema_version": 1, "name": "own", "sources": sources, **changes}
    (folder / "campaign.yaml").write_text(yaml.safe_dump(content), encoding="utf-8")
    return str(folder / "campaign.yaml")


def evaluated(folder: Path, *arguments: str) -> str:
    """Digest of the run."""
    output = folder / "results"
    command = ["evaluate", *arguments, "-q", "-j", "1", "-o", str(output), "--force"]
    assert main(command) == 0
    return str(json.loads((output / "results.jsonl").read_text(encoding="utf-8"))["digest"])


def test_a_campaign_names_its_stand_from_its_own_folder(
    mine: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    place = mine.parent / "campaigns"
    place.mkdir()
    named = campaign(place, stand="../mine")
    monkeypatch.chdir(place)
    assert evaluated(place, named) == digest()
    edit(mine / "actuator.yaml", description="with a longer screw")
    said = refused(capsys, "evaluate", named, "-o", "refused")
    assert "made for actuator 'flea' (sha256 " in said
    assert evaluated(place, named, "--stand", "flea") == digest()
    said = refused(capsys, "evaluate", campaign(place), "--stand", "../mine", "-o", "refused")
    assert "made for actuator 'flea' (sha256 " in said
    assert not (place / "refused").exists()


def test_a_folder_of_bags_is_evaluated_on_a_stand(
    mine: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (mine / CALIBRATION).rename(mine.parent / "my.yaml")
    said = refused(capsys, "evaluate", str(BAG), "--stand", "./mine", "-o", "refused")
    assert "no such calibration" in said
    given = ("--stand", "./mine", "--calibration", "my.yaml")
    assert evaluated(mine.parent, str(BAG.parent / "nominal"), *given) == digest()
