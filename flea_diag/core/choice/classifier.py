"""Feature-only baseline: a classifier on all features at once, without a model.

Named as the usual alternative by Narasimhan et al. 2010, section 3.2. A small network of plain
numbers: trained elsewhere, read from JSON, never from executable code.
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
"""Inputs are clipped at this many spreads, so that unseen values cannot dominate the answer."""


class Classifier(Protocol):
    """From the values of features to a probability of each fault."""

    @property
    def features(self) -> tuple[str, ...]:
        """Ids of all that has to be computed."""

    def probabilities(self, values: Mapping[str, float]) -> dict[str, float]:
        """Probability of each class; a value that is missing or NaN counts as average."""


@dataclass(frozen=True, eq=False)
class Perceptron:
    """Fully connected network: rectifiers in the hidden layers, softmax at the end.

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
            Naming ``where`` and what does not fit: a key, a shape, a number.
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
        """Refuse numbers that are not finite and shapes that do not fit each other."""
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
    """Values (rows, features) on a scale on which they spread evenly; NaN where one is missing.

    Signed logarithm: levels spread by factors, correlations about zero.
    """
    found = np.array([[row.get(name, math.nan) for name in features] for row in rows], np.float64)
    return np.asarray(np.sign(found) * np.log1p(100.0 * np.abs(found)))


def standardised(values: Array, means: Array, scales: Array) -> Array:
    """Inputs of the network: spreads from the mean, cut at ``FARTHEST``; average where unknown."""
    inputs = np.clip((values - means) / scales, -FARTHEST, FARTHEST)
    return np.asarray(np.where(np.isfinite(inputs), inputs, 0.0))
