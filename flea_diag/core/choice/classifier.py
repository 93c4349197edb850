# Copyright 2026 flea_diag maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Feature-only baseline: a classifier on all features at once, without a model.

Narasimhan et al. 2010, section 3.2, name it as the usual alternative. A small network, trained
elsewhere and stored as numbers in JSON, never as executable code.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from flea_diag.fields.reader import read_as
from flea_diag.fields.values import FINITE, AboveZero
from flea_diag.formats import migrated, stamped

Array = npt.NDArray[np.float64]
FARTHEST = 5.0
"""Inputs are clipped at this many standard deviations, so that outliers cannot dominate."""


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
        """Probability of each class; a value that is missing or NaN counts as average."""
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
        known = read_as(
            _NetworkFile, migrated("classifier", content, where), where, magnitudes=FINITE
        )
        layers = ((np.array(each.weights), np.array(each.offsets)) for each in known.layers)
        means, scales = np.array(known.means), np.array(known.scales)
        return cls(known.features, known.faults, means, scales, tuple(layers), known.source)


@dataclass(frozen=True)
class _Layer:
    """One row of weights for each input, one offset for each output."""

    weights: tuple[tuple[float, ...], ...]
    offsets: tuple[float, ...]


@dataclass(frozen=True)
class _NetworkFile:
    """The file of a network; each layer has as many inputs as the one before has outputs."""

    source: str
    features: tuple[str, ...]
    faults: tuple[str, ...]
    means: tuple[float, ...]
    scales: tuple[AboveZero, ...]
    layers: tuple[_Layer, ...]

    def __post_init__(self) -> None:
        width = len(self.features)
        if not len(self.means) == len(self.scales) == width:
            raise ValueError(f"means and scales must have {width} entries, one for each feature")
        for layer in self.layers:
            outputs = len(layer.offsets)
            if len(layer.weights) != width or any(len(row) != outputs for row in layer.weights):
                raise ValueError(f"a layer must have {width} rows of {outputs} weights")
            width = outputs
        if not self.layers or width != len(self.faults):
            ends = f"{len(self.features)} features to {len(self.faults)} faults"
            raise ValueError(f"layers do not lead from {ends}")


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
