"""The quantitative half of isolation: which residuals are weighed, by which models, and when."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.likelihood.fault_models import (
    DRIVE,
    REGRESSORS,
    FaultModel,
    drag_models,
    plant_models,
)
from flea_diag.core.likelihood.likelihood import NormalEquations
from flea_diag.core.likelihood.sensor_models import sensor_models
from flea_diag.core.likelihood.unit_baseline import UnitBaseline
from flea_diag.stages.isolator.episode import MOTION_ONLY, Episode, relation
from flea_diag.wire.blocks import ResidualBlock, block_of
from flea_diag.wire.records import Residual

Array = npt.NDArray[np.float64]
Stamps = npt.NDArray[np.int64]

WEIGHED = (
    "parity_mechanical",
    "parity_electrical",
    DRIVE,
    "parity_kinematic",
    "parity_speed",
    "motor_temperature",
    "nut_temperature",
    "ambient_temperature",
)
"""Residuals that the quantitative fault models explain."""
SHOWN = ("parity_electrical",)
"""Relations in which a unit shows its own parameters. Not the one with friction: a drag that is
there from the start would pass for the unit's."""
SHOWN_BEFORE = (*SHOWN, *MOTION_ONLY)
"""Where the relation with friction left its own level of this run, its drag is not of the start."""
WEIGH_EVERY_NS = 500_000_000


class Weighing:
    """Models of the faults on this stand, and what its unit showed while it was healthy.

    Attributes
    ----------
    names
        Residuals that are weighed here.
    models
        Of the faults that move one of them: any other cannot be weighed on this stand.
    """

    def __init__(self, calibration: Calibration) -> None:
        limits, fitted = calibration.limits, calibration.parameters
        self._tolerances = calibration.differences()
        self._sigma = {limit.name: limit.sigma[0] for limit in limits}
        self._own_sigma = self._sigma | _own_sigma(calibration)
        self._correlation = {limit.name: limit.correlation_samples for limit in limits}
        self.names = tuple(name for name in WEIGHED if name in self._sigma)
        self.models = self._told(plant_models(fitted) + sensor_models(fitted, DRIVE in self.names))
        self._dragging = self._told(drag_models(fitted, dragging=True))
        self._healthy = UnitBaseline(self.names)
        self._waiting: list[Residual] = []

    def _told(self, models: tuple[FaultModel, ...]) -> tuple[FaultModel, ...]:
        """Models that move one of the residuals of this stand."""
        return tuple(m for m in models if any(term.residual in self.names for term in m.terms))

    def begin(self) -> NormalEquations:
        """An episode begins: what the unit shows from now on is not its healthy self."""
        self._waiting.clear()
        self._healthy.interrupt()
        return NormalEquations(self.names)

    def forget(self) -> None:
        """Another unit is in use: what the last one showed says nothing of it."""
        self._waiting.clear()
        self._healthy = UnitBaseline(self.names)

    def see(self, record: Residual) -> None:
        """``show`` for one scan; those that are kept wait until their piece is over."""
        if self._waiting and record.names != self._waiting[0].names:
            self._keep()
        if self._healthy.count():
            self._waiting.append(record)
        if self._healthy.is_piece_over:
            self._keep()

    def _keep(self) -> None:
        """What waits is taken in."""
        if self._waiting:
            self._healthy.keep(*self._shown(block_of(*self._waiting)))
            self._waiting.clear()

    def show(self, block: ResidualBlock) -> None:
        """What the unit shows of itself while nothing deviates."""
        self._keep()
        self._healthy.add(*self._shown(block))

    def _shown(self, block: ResidualBlock) -> tuple[Array, Array]:
        """Residuals in which a unit shows its parameters, NaN where it does not; regressors."""
        values = np.full((len(block), len(self.names)), np.nan)
        resting = block.regressors[:, -1] <= 0.5
        for column, name in enumerate(self.names):
            if name in SHOWN_BEFORE and name in block.names:
                values[:, column] = block.values[:, block.names.index(name)]
                if name in MOTION_ONLY:
                    values[resting, column] = np.nan
        return values, block.regressors[:, : len(REGRESSORS)]

    def weigh(self, stamp_ns: int, episode: Episode, drop_nats: float, gating: bool) -> None:
        """Take the likelihoods of an episode's evidence into its isolation."""
        alive = {hypothesis.name for hypothesis in episode.isolation.alive()}
        silent = episode.is_silent
        known = self._dragging if silent else self.models
        models = [model for model in known if model.fault in alive]
        if not (models and (episode.symbols or silent) and episode.scans):
            return
        healthy = self._healthy.evidence
        slid = relation(episode.shifted) in MOTION_ONLY and not episode.heard
        own = healthy is not None and (slid or silent)
        fits = episode.likelihood.fit(
            models,
            self._own_sigma if own else self._sigma,
            self._correlation,
            self._tolerances,
            healthy,
            SHOWN_BEFORE if own else SHOWN,
        )
        conclusive = episode.conclusive() or not gating
        episode.isolation.apply_likelihoods(stamp_ns, fits, drop_nats if conclusive else math.inf)


def _own_sigma(calibration: Calibration) -> dict[str, float]:
    """Scatter of the relations about one unit's own level, as the means of their shifts have it.

    That of all recordings also holds what units differ by.
    """
    found = {}
    for shift in calibration.shifts:  # of one relation, the longest window comes last
        limit = calibration.limit(shift.name)
        if shift.name in SHOWN_BEFORE and limit is not None:
            independent = shift.window / limit.correlation_samples
            found[shift.name] = min(shift.sigma * math.sqrt(independent), limit.sigma[0])
    return found


def due(episode: Episode, stamp_ns: int) -> bool:
    """Whether another half second of evidence is there; takes note that it is."""
    number = round((stamp_ns - episode.start_ns) / WEIGH_EVERY_NS)
    before, episode.weighed_at = episode.weighed_at, number
    return number != before


def weighings(episode: Episode, stamps_ns: Stamps) -> Iterator[int]:
    """Ends of the stretches of a block after which likelihoods are due."""
    numbers = np.rint((stamps_ns - episode.start_ns) / WEIGH_EVERY_NS)
    yield from (np.flatnonzero(numbers != np.append(episode.weighed_at, numbers[:-1])) + 1).tolist()
