"""``flea stand new``: writes the folder of a stand."""

from __future__ import annotations

import argparse
from pathlib import Path

from flea_diag.errors import ConfigurationError
from flea_diag.tools.terminal import make_folder, say, write_text

SUMMARY = "write the folder of a stand: description, fault catalogue and feature table"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("folder", type=Path, metavar="DIR", help="folder to write, new or empty")
    parser.add_argument(
        "--template",
        required=True,
        metavar="NAME",
        help="kind of actuator: dc_screw, wing and others",
    )


def run(arguments: argparse.Namespace) -> int:
    """Write the folder."""
    from flea_diag.tools.stand_folder.template import template

    folder: Path = arguments.folder
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise ConfigurationError(f"{folder} exists and is not empty: name a new folder")
    chosen = template(arguments.template)
    make_folder(folder)
    name = folder.resolve().name
    for key, path in (
        ("actuator", chosen.stand.actuator),
        ("faults", chosen.stand.faults),
        ("feature_table", chosen.stand.features),
    ):
        text = path.read_text(encoding="utf-8")
        if key == "actuator":
            text = text.replace(f"\nname: {chosen.stand.name}\n", f"\nname: {name}\n", 1)
        write_text(folder / f"{key}.yaml", text)
    write_text(folder / "stand.yaml", STAND.format(title=chosen.title, name=name))
    say(f"{folder}: {chosen.title}, as stand {chosen.stand.name} describes it")
    return 0


STAND = """\
# {title}. Files are named relative to this folder; the calibration is made by flea calibrate.
schema_version: 1
name: {name}
actuator: actuator.yaml
faults: faults.yaml
calibration: calibration.yaml
features: feature_table.yaml
"""
