"""The diagnosers that a campaign can run, by name: ours, and what it is held against.

A new one is a row: a function from the calibration's file (None: the simulated stand's) to a
fresh stage that takes the stand's records and answers with AmbiguityGroup records.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from flea_diag.errors import ConfigurationError

if TYPE_CHECKING:
    from flea_diag.stages.pipeline import Pipeline

Make = Callable[[Path | None], "Pipeline"]


def _default(calibration: Path | None) -> Pipeline:
    from flea_diag.configuration import make_pipeline

    return make_pipeline(calibration)


CONFIGURATIONS: dict[str, Make] = {"default": _default}


def configuration_named(name: str, where: str) -> Make:
    """Function that builds this diagnoser.

    Raises
    ------
    ConfigurationError
        No such configuration.
    """
    if name not in CONFIGURATIONS:
        raise ConfigurationError(
            f"{where}: configuration {name!r} is unknown, choose among {', '.join(CONFIGURATIONS)}"
        )
    return CONFIGURATIONS[name]
