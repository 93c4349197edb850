"""Templates: kinds of actuators, each with the shipped stand whose description it takes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

from flea_diag.configuration.files import config_folders, load_yaml
from flea_diag.configuration.stand import load_stand
from flea_diag.core.schema import REQUIRED, Keys, read
from flea_diag.errors import ConfigurationError, shown
from flea_diag.formats import migrated

if TYPE_CHECKING:
    from pathlib import Path

    from flea_diag.configuration.stand import Stand

FOLDER = "templates"
KEYS: Keys = {"title": (str, REQUIRED), "stand": (str, REQUIRED)}


@dataclass(frozen=True)
class Template:
    """One kind of actuator.

    Parameters
    ----------
    name
        For ``--template``.
    title
        For people.
    stand
        The shipped stand whose description, fault catalogue and feature table it takes.
    """

    name: str
    title: str
    stand: Stand


@lru_cache(maxsize=1)
def template_files() -> dict[str, Path]:
    """Name of each template -> its file."""
    found: dict[str, Path] = {}
    for folder in config_folders():
        for path in sorted(folder.glob(f"{FOLDER}/*.yaml")):
            found.setdefault(path.stem, path)
    return found


def template(name: str) -> Template:
    """A template by its name.

    Raises
    ------
    ConfigurationError
        There is none of this name, or it is refused.
    """
    files = template_files()
    if name not in files:
        raise ConfigurationError(
            f"template {shown(name)} is not shipped, known are {', '.join(files) or 'none'}"
        )
    where = str(files[name])
    values = read(migrated("stand template", load_yaml(files[name]), where), where, KEYS)
    return Template(name, values["title"], load_stand(values["stand"]))
