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

"""A stand is a folder, named by name or by path, and nothing is found in the working directory."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
import yaml
from support.places import CONFIG, FLEA_STAND, SHIPPED_STANDS

from flea_diag.configuration.files import config_path, found_file, given_file, load_yaml
from flea_diag.configuration.stand import load_stand, shipped_stands
from flea_diag.errors import ConfigurationError

KNOWN = ", ".join(SHIPPED_STANDS)
SHIPPED = {
    "schema_version": 1,
    "name": "flea",
    "actuator": "actuator.yaml",
    "faults": "faults.yaml",
    "calibration": "calibration_simulated_stand.yaml",
    "features": "feature_table.yaml",
    "channels": "channels.yaml",
    "kinematics": {
        "ball_screw": {
            "pitch_diameter_m": 9.9e-3, "ball_diameter_m": 1.588e-3, "lead_m": 3.175e-3,
        },
    },
}  # fmt: skip


def folder_of(parent: Path, place: str = "mine", /, **changes: object) -> Path:
    """A folder with a ``stand.yaml`` like the shipped one, but for some entries."""
    content = {**SHIPPED, **changes}
    folder = parent / place
    folder.mkdir()
    (folder / "stand.yaml").write_text(yaml.safe_dump(content), encoding="utf-8")
    return folder


# --- the shipped one ------------------------------------------------------------------------


def test_the_flea_is_shipped_as_a_folder() -> None:
    assert yaml.safe_load((FLEA_STAND / "stand.yaml").read_text()) == SHIPPED
    assert shipped_stands() == SHIPPED_STANDS
    assert SHIPPED_STANDS["flea"] == FLEA_STAND
    stand = load_stand()
    assert stand == load_stand("flea")
    assert stand == load_stand(FLEA_STAND)
    named = {stand.actuator, stand.faults, stand.calibration, stand.features, stand.channels}
    beside = {path for path in FLEA_STAND.iterdir() if path.name != "stand.yaml"}
    assert {*named, FLEA_STAND / "README.md"} == beside


def test_texts_are_those_of_all_its_files() -> None:
    kept = load_stand(calibration=config_path("calibration_simulated_stand.yaml")).texts()
    assert kept == {
        "stand.yaml": (FLEA_STAND / "stand.yaml").read_text(encoding="utf-8"),
        "actuator.yaml": (FLEA_STAND / "actuator.yaml").read_text(encoding="utf-8"),
        "faults.yaml": (FLEA_STAND / "faults.yaml").read_text(encoding="utf-8"),
        "calibration.yaml": (FLEA_STAND / SHIPPED["calibration"]).read_text(encoding="utf-8"),
        "features.yaml": (FLEA_STAND / "feature_table.yaml").read_text(encoding="utf-8"),
        "channels.yaml": (FLEA_STAND / "channels.yaml").read_text(encoding="utf-8"),
    }


# --- what stand.yaml may say -----------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"schema_version": 2}, "stand has schema_version = 2, this flea_diag reads 1: made by a"),
        ({"channel": "x.yaml"}, "unknown key 'channel', known are name, actuator, faults"),
        ({"actuator": 5}, "actuator = 5 must be text"),
        ({"features": None}, "features = None must be text"),
        ({"faults": "/etc/passwd"}, "faults = '/etc/passwd' must lie inside the folder"),
        ({"faults": "../faults.yaml"}, "faults = '../faults.yaml' must lie inside the folder"),
        ({"faults": "a/../../b.yaml"}, "faults = 'a/../../b.yaml' must lie inside the folder"),
        ({"calibration": ""}, "calibration = '' is no name of a file"),
        ({"calibration": "."}, "calibration = '.' is no name of a file"),
        ({"calibration": "a\0b"}, r"calibration = 'a\x00b' is no name of a file"),
        (
            {"kinematics": {"bearing": {"pitch_diameter_m": 0.04, "ball_diameter_m": 0.008}}},
            "kinematics: bearing: balls is missing; give it",
        ),
        (
            {"kinematics": {"ball_screw": {**SHIPPED["kinematics"]["ball_screw"], "lead_m": -1.0}}},
            "kinematics: ball_screw: lead_m = -1.0 must be above 0",
        ),
        (
            {
                "kinematics": {
                    "bearing": {"pitch_diameter_m": 8.0, "ball_diameter_m": 40.0, "balls": 9}
                }
            },
            "kinematics: bearing: ball_diameter_m = 40 must be below pitch_diameter_m = 8",
        ),
        ({"name": " "}, "name = ' ' is no name; give one"),
        ({"name": "a\nb"}, r"name = 'a\nb' is no name; give one"),
    ],
)
def test_an_entry_is_refused_in_one_line(
    tmp_path: Path, changes: dict[str, object], words: str
) -> None:
    with pytest.raises(ConfigurationError) as refusal:
        load_stand(folder_of(tmp_path, **changes))
    text = str(refusal.value)
    assert text.startswith(f"{tmp_path}/mine/stand.yaml: ")
    assert words in text
    assert text.isprintable()


@pytest.mark.parametrize(
    "key", [key for key in SHIPPED if key not in ("schema_version", "channels", "kinematics")]
)
def test_every_entry_is_needed(tmp_path: Path, key: str) -> None:
    folder = folder_of(tmp_path)
    content = {name: value for name, value in SHIPPED.items() if name != key}
    (folder / "stand.yaml").write_text(yaml.safe_dump(content), encoding="utf-8")
    with pytest.raises(ConfigurationError, match=f"stand.yaml: {key} is missing; give it$"):
        load_stand(folder)


def test_files_may_lie_deeper_in_the_folder_and_be_links(tmp_path: Path) -> None:
    folder = folder_of(tmp_path, actuator="model/actuator.yaml", faults="faults.yaml")
    (folder / "model").mkdir()
    shutil.copy(FLEA_STAND / "actuator.yaml", folder / "model")
    (folder / "faults.yaml").symlink_to(FLEA_STAND / "faults.yaml")
    stand = load_stand(folder)
    assert load_yaml(stand.actuator) == load_yaml(FLEA_STAND / "actuator.yaml")
    assert load_yaml(stand.faults) == load_yaml(FLEA_STAND / "faults.yaml")


# --- which folder is meant -------------------------------------------------------------------


def test_a_path_has_a_separator_and_a_bare_name_is_shipped(here: Path) -> None:
    folder_of(here)
    folder_of(here, "flea", name="not the shipped one")
    assert load_stand("./mine").actuator == here / "mine" / "actuator.yaml"
    assert load_stand("flea").name == "flea"
    assert load_stand("./flea").name == "not the shipped one"
    with pytest.raises(
        ConfigurationError,
        match=rf"^stand 'mine' is not shipped, known are {KNOWN}; the folder here is \./mine$",
    ):
        load_stand("mine")
    with pytest.raises(
        ConfigurationError,
        match=rf"^stand 'else' is not shipped, known are {KNOWN}; a folder of your own is \./else$",
    ):
        load_stand("else")


def test_the_folder_itself_is_a_dot(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder_of(here, name="my own"))
    assert load_stand(".").name == "my own"
    assert load_stand(".").faults == here / "mine" / "faults.yaml"
    (here / "stand.yaml").unlink()
    with pytest.raises(ConfigurationError, match=r"^stand '\.\.' has no stand\.yaml: write one"):
        load_stand("..")


def test_what_is_no_folder_of_a_stand_is_refused(tmp_path: Path) -> None:
    folder = folder_of(tmp_path)
    for path, words in (
        (folder / "stand.yaml", " is a file, a stand is a folder: name that"),
        (tmp_path, " has no stand.yaml: write one after config/stands/flea/stand.yaml"),
        (tmp_path / "none", ": no such folder"),
    ):
        with pytest.raises(ConfigurationError, match=rf"^stand '\S+'{re.escape(words)}$"):
            load_stand(path)


# --- the working directory -------------------------------------------------------------------


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working directory with rubbish under every shipped name."""
    for path in [*CONFIG.glob("*.yaml"), *FLEA_STAND.glob("*.yaml")]:
        (tmp_path / path.name).write_text("rubbish", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.usefixtures("here")
def test_no_default_takes_a_file_of_the_working_directory() -> None:
    stand = load_stand()
    for path in (stand.actuator, stand.faults, stand.calibration, stand.features):
        assert path.parent == FLEA_STAND
    assert load_yaml("actuator.yaml")["name"] == "flea"
    assert found_file("faults.yaml") == FLEA_STAND / "faults.yaml"


def test_what_a_user_names_is_a_file_of_the_working_directory_first(here: Path) -> None:
    (here / "mine.yaml").write_text("a: 1", encoding="utf-8")
    assert load_yaml(given_file("mine.yaml")) == {"a": 1}
    assert given_file("actuator.yaml") == here / "actuator.yaml"
    assert load_stand(calibration="mine.yaml").calibration == here / "mine.yaml"
    (here / "actuator.yaml").unlink()
    assert given_file("actuator.yaml") == FLEA_STAND / "actuator.yaml"
    with pytest.raises(ConfigurationError, match=r"^\S+/actuator\.yaml: no such file$"):
        load_yaml(given_file("./actuator.yaml"))


def test_a_bare_name_that_is_here_alone_is_refused_with_its_path(here: Path) -> None:
    (here / "mine.yaml").write_text("a: 1", encoding="utf-8")
    with pytest.raises(
        ConfigurationError,
        match=r"^mine\.yaml: no such file is shipped; the file of the working directory is "
        r"\./mine\.yaml$",
    ):
        load_yaml("mine.yaml")
    assert load_yaml("./mine.yaml") == {"a": 1}
