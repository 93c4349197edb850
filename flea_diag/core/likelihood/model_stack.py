"""Fault models of equal numbers of sizes, fitted side by side to the same evidence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.core.likelihood.bounded_systems import BoundedSystems
from flea_diag.core.likelihood.fault_models import FaultModel
from flea_diag.core.residuals.unit_difference import Unit

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ModelStack:
    """Designs of m models and the sums of an episode that they meet.

    Attributes
    ----------
    models
        With equal numbers of sizes; None is the model without a fault.
    places
        Index of the design of each model: many models differ in their bounds alone.
    designs
        How sizes and unit parameters enter each residual, shape (d, residuals, signals, unknowns).
    moments
        Gram matrix of each residual by its design, the same shape.
    cross
        Products of residuals and signals, shape (residuals, signals).
    """

    models: Sequence[FaultModel | None]
    places: list[int]
    designs: Array
    moments: Array
    cross: Array

    @property
    def faults(self) -> list[FaultModel]:
        """The models that are of a fault."""
        return [model for model in self.models if model is not None]

    def part(self, which: Sequence[int]) -> ModelStack:
        """Some of the models, each with a design of its own."""
        models, rows = [self.models[k] for k in which], [self.places[k] for k in which]
        own = list(range(len(rows)))
        return ModelStack(models, own, self.designs[rows], self.moments[rows], self.cross)

    def systems(self, weight: Array, unit: Unit) -> BoundedSystems:
        """Normal equations with these weights of the residuals, for all or for each design."""
        weighed = self.designs.transpose(0, 1, 3, 2) * weight[..., None, None]
        A = np.matmul(weighed, self.moments).sum(axis=1)
        b = np.matmul(weighed, self.cross[:, :, None])[..., 0].sum(axis=1)
        systems = BoundedSystems(self.models, self.places, A, b)
        A[:, systems.count :, systems.count :] += unit.information
        b[:, systems.count :] += unit.vector
        return systems

    def effects(self, unknowns: Array) -> Array:
        """What these unknowns, shape (m, unknowns), add to each residual, as factors of signals."""
        designs = self.designs[self.places]
        return np.asarray(np.matmul(designs, unknowns[:, None, :, None])[..., 0])
