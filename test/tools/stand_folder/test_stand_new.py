"""``flea stand new``: the folder that it writes is a stand, and what it refuses."""

from __future__ import annotations

from pathlib import Path

import pytest

from flea_diag.configuration.description import described, faults_of
from flea_diag.configuration.knowledge import load_features
from flea_diag.configuration.stand import load_stand
from flea_diag.tools.main import main
from flea_diag.tools.stand_folder.template import template_files


@pytest.mark.parametrize("name", template_files())
def test_a_template_becomes_a_stand_of_its_own_name(tmp_path: Path, name: str) -> None:
    folder = tmp_path / "mine"
    assert main(["stand", "new", str(folder), "--template", name]) == 0
    stand = load_stand(folder)
    assert (stand.name, described(stand.actuator).name) == ("mine", "mine")
    assert faults_of(stand.actuator, stand.faults)
    assert load_features(stand.features).features


def test_a_folder_with_files_and_an_unknown_template_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "kept.txt").write_text("kept")
    assert main(["stand", "new", str(tmp_path), "--template", "wing"]) == 2
    assert (
        capsys.readouterr().err == f"flea: {tmp_path} exists and is not empty: name a new folder\n"
    )
    assert main(["stand", "new", str(tmp_path / "mine"), "--template", "rocket"]) == 2
    assert "template 'rocket' is not shipped, known are dc_screw, " in capsys.readouterr().err
    assert not (tmp_path / "mine").exists()
