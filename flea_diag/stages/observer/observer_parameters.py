"""Parameters of the observer."""

from __future__ import annotations

from dataclasses import dataclass

from flea_diag.stages.observer.state_estimate import KINDS, NONE
from flea_diag.wire.parameters import parameter


@dataclass(frozen=True)
class ObserverParameters:
    """What a user may set on the observer."""

    warm_up_s: float = parameter(
        6.0,
        "time at the start of a stream in which the unit's own sensor offsets are learned",
        unit="s",
        minimum=0.0,
        maximum=60.0,
    )
    rearm_after_s: float = parameter(
        30.0,
        "time without any detection that closes an episode (0: only by ~/reset)",
        unit="s",
        minimum=0.0,
        maximum=3600.0,
    )
    gap_scans: int = parameter(
        10, "missing scans after which smoothing restarts", minimum=2, maximum=1000
    )
    state_observer: str = parameter(
        "particle",
        "what estimates the states for detection: particle or Kalman filter, or none (fastest)",
        choices=(*KINDS, NONE),
    )
    observer_backend: str = parameter(
        "auto", "what computes particle filter and tests", choices=("auto", "numpy", "numba")
    )
    observer_seed: int = parameter(
        1, "seed of the particle filter's random numbers", minimum=0, maximum=2**31 - 1
    )
