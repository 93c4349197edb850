"""Feature-only baseline: a classifier on all features at once, without a model.

Narasimhan et al. 2010, section 3.2, name it as the usual alternative. A small network, trained
elsewhere and stored as numbers in JSON, never as executable code.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from flea_diag.errors import ConfigurationError, shown
from flea_diag.formats import migrated, stamped

Array = npt.NDArray[np.float64]
KEYS = frozenset({"source", "features", "faults", "means", "scales", "layers"})
FARTHEST = 5.0
"""Inputs are clipped at this many standard deviations, so that outliers cannot dominate."""


class Classifier(Protocol):
    """Maps the values of features to a probability of each fault."""

    @property
    def features(self) -> tuple[str, ...]:
        """Ids of all features required."""

    def probabilities(self, values: Mapping[str, float]) -> dict[str, float]:
        """Probability of each class; a value that is missing or NaN counts as average."""


@dataclass(frozen=True, eq=False)
class Perceptron:
    """Fully connected network: ReLU in the hidden layers, softmax output.

    Parameters
    ----------
    means, scales : (features,) of the inputs, already as `scaled` makes them
    layers : weights (inputs, outputs) and offsets (outputs,) of each layer
    """

    features: tuple[str, ...]
    faults: tuple[str, ...]
    means: Array
    scales: Array
    layers: tuple[tuple[Array, Array], ...]
    source: str = ""

    def probabilities(self, values: Mapping[str, float]) -> dict[str, float]:
        """Probability of each class."""
        signal = standardised(scaled([values], self.features), self.means, self.scales)[0]
        for weights, offsets in self.layers[:-1]:
            signal = np.maximum(signal @ weights + offsets, 0.0)
        weights, offsets = self.layers[-1]
        logits = signal @ weights + offsets
        odds = np.exp(logits - logits.max())
        return dict(zip(self.faults, (odds / odds.sum()).tolist(), strict=True))

    def as_mapping(self) -> dict[str, Any]:
        """Plain values for JSON."""
        content = {
            "source": self.source,
            "features": list(self.features),
            "faults": list(self.faults),
            "means": self.means.tolist(),
            "scales": self.scales.tolist(),
            "layers": [{"weights": w.tolist(), "offsets": b.tolist()} for w, b in self.layers],
        }
        return stamped("classifier", content)

    @classmethod
    def from_mapping(cls, content: object, where: str) -> Perceptron:
        """Network from plain values.

        Raises
        ------
        ConfigurationError
            A key, shape or number is invalid; ``where`` is named.
        """
        mapping = migrated("classifier", content, where)
        if set(mapping) != KEYS:
            raise ConfigurationError(f"{where}: must hold exactly {', '.join(sorted(KEYS))}")
        try:
            found = cls(
                tuple(map(str, mapping["features"])),
                tuple(map(str, mapping["faults"])),
                np.array(mapping["means"], dtype=np.float64),
                np.array(mapping["scales"], dtype=np.float64),
                tuple(
                    (np.array(row["weights"], np.float64), np.array(row["offsets"], np.float64))
                    for row in mapping["layers"]
                ),
                str(mapping["source"]),
            )
        except (TypeError, ValueError, KeyError) as error:
            raise ConfigurationError(
                f"{where}: not a classifier: {type(error).__name__}: {shown(str(error))}"
            ) from error
        found._check(where)
        return found

    def _check(self, where: str) -> None:
        """Refuse numbers that are not finite and shapes that are inconsistent."""
        if self.means.shape != self.scales.shape or not (self.scales > 0.0).all():
            raise ConfigurationError(f"{where}: means and scales must be as many, scales positive")
        width = len(self.features)
        shapes = [self.means.shape == (width,), bool(self.layers)]
        for weights, offsets in self.layers:
            shapes.append(weights.shape == (width, len(offsets)) and offsets.ndim == 1)
            width = len(offsets)
        if not all(shapes) or width != len(self.faults):
            raise ConfigurationError(
                f"{where}: layers do not lead from {len(self.features)} features to "
                f"{len(self.faults)} faults"
            )
        numbers = [self.means, *(part for layer in self.layers for part in layer)]
        if not all(np.isfinite(part).all() for part in numbers):
            raise ConfigurationError(f"{where}: holds numbers that are not finite")


def scaled(rows: Sequence[Mapping[str, float]], features: Sequence[str]) -> Array:
    """Values (rows, features) by signed logarithm; NaN where one is missing.

    Levels vary by factors, correlations about zero; both then vary on a similar scale.
    """
    found = np.array([[row.get(name, math.nan) for name in features] for row in rows], np.float64)
    return np.asarray(np.sign(found) * np.log1p(100.0 * np.abs(found)))


def standardised(values: Array, means: Array, scales: Array) -> Array:
    """Standardised inputs of the network, clipped at ``FARTHEST``; the mean where unknown."""
    inputs = np.clip((values - means) / scales, -FARTHEST, FARTHEST)
    return np.asarray(np.where(np.isfinite(inputs), inputs, 0.0))
