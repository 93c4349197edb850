"""Location of the scenarios shipped with the package: the source tree or the prefix."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path

from flea_diag.errors import ConfigurationError, shown
from flea_sim_driver.scenario.scenario import Scenario
from flea_sim_driver.scenario.scenario_file import load_scenario

INSTALLED = Path("share/flea_diag/config/scenarios")


def _folders() -> Iterator[Path]:
    yield Path(__file__).resolve().parents[2] / "config" / "scenarios"
    for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep):
        if prefix:
            yield Path(prefix) / INSTALLED
    yield Path(sys.prefix) / INSTALLED
    # A prefix that is none of Python's own: .../lib/python3.x/site-packages/flea_sim_driver.
    for above in Path(__file__).resolve().parents:
        yield above / INSTALLED


def scenario_names() -> tuple[str, ...]:
    """Names of the scenarios shipped with the package."""
    for folder in _folders():
        if folder.is_dir():
            return tuple(sorted(path.stem for path in folder.glob("*.yaml")))
    return ()


def find_scenario(name_or_path: str) -> Scenario:
    """Scenario from a file, or by name from those shipped with the package.

    Raises
    ------
    ConfigurationError
        No such file or name, or its content is refused.
    """
    path = Path(name_or_path)
    if path.suffix in (".yaml", ".yml"):
        return load_scenario(path)
    for folder in _folders():
        candidate = folder / f"{name_or_path}.yaml"
        if candidate.is_file() and candidate.parent == folder:
            return load_scenario(candidate)
    if path.is_file():
        return load_scenario(path)
    raise ConfigurationError(
        f"scenario {shown(name_or_path)} is neither a YAML file nor one of "
        f"{', '.join(scenario_names()) or 'the installed ones (none found)'}"
    )
