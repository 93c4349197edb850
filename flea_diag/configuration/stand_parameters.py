"""The parameters by which a node is told its stand."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from flea_diag.configuration.files import DEFAULT_STAND
from flea_diag.configuration.stand import Stand, load_stand
from flea_diag.wire.parameters import parameter


@dataclass(frozen=True)
class StandParameters:
    """Which stand a node is for."""

    stand: str = parameter(
        DEFAULT_STAND,
        "name of a shipped stand, or the folder of one as a path (./mine)",
        read_only=True,
    )
    calibration: str = parameter("", "calibration file; empty: that of the stand", read_only=True)


def stand_of(parameters: Any) -> Stand:
    """The stand that parameters name."""
    return load_stand(parameters.stand, calibration=parameters.calibration)
