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

"""Leverage of chosen operating points on a calibration: what its recordings did not cover."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from flea_diag.core.calibration.calibration import Calibration
    from flea_diag.core.residuals.relation_set import RelationSet

Array = npt.NDArray[np.float64]

NAMED = 2
"""Operating points that are named for each relation."""
SLOW = 0.5
"""Of the largest speed: what most motions reach together with the largest load."""


class OperatingPoints:
    """Leverage at operating points that are given by a few signals, in steady motion."""

    def __init__(self, calibration: Calibration, relations: RelationSet) -> None:
        from flea_diag.core.residuals.leverage import LeverageBasis

        assert calibration.envelope is not None
        self.envelope = calibration.envelope
        self._basis, self._relations = LeverageBasis(relations), relations
        self._parameters = asdict(calibration.parameters)

    def axes(self, relation: str) -> tuple[str, ...]:
        """Signals that make an operating point of a relation: speed, load or current, position."""
        held = filter(self._is_free, self._basis.read[relation])
        along = relation != self._relations.residuals.circuit and self.envelope.position
        return (*held, *((self.envelope.position,) if along else ()))

    def _is_free(self, signal: str) -> bool:
        """Whether it is no shape, and no acceleration."""
        return signal not in self._relations.shapes and not self._is_acceleration(signal)

    def _is_acceleration(self, signal: str) -> bool:
        from flea_diag.core.residuals.measured_graph import channel_of

        channel, order = channel_of(signal)
        return order > (channel != self._relations.residuals.encoder)

    def leverages(self, points: Mapping[str, Array]) -> dict[str, Array]:
        """Leverage of each relation at points given by columns of signals, shape (n,).

        A signal that is not given is 0.
        """
        from flea_diag.core.residuals.leverage import leverages
        from flea_diag.core.symbolic.expression import evaluate

        count = len(next(iter(points.values())))
        columns = dict.fromkeys(self._relations.signals, np.zeros(count)) | dict(points)
        known = {**self._parameters, **columns}
        for name, shape in self._relations.shapes.items():
            columns[name] = np.broadcast_to(np.asarray(evaluate(shape, known)), (count,))
        signals = np.stack([columns[name] for name in self._relations.signals], axis=1)
        position = columns.get(self.envelope.position, np.zeros(count))
        psi, basis = self._basis.rows(signals, position), self._basis
        ends = dict(zip(basis.names, (*basis.starts[1:], basis.width), strict=True))
        starts = dict(zip(basis.names, basis.starts, strict=True))
        return {
            row.relation: leverages(
                psi[:, starts[row.relation] : ends[row.relation]], np.array(row.root), (0,)
            )[:, 0]
            for row in self.envelope.relations
        }

    def not_covered(self) -> Iterator[str]:
        """Extremes that occurred, but not together: of each relation those with most leverage."""
        for row in self.envelope.relations:
            names = self.axes(row.relation)
            ends = [self._ends(name) for name in names]
            corners = np.array(list(product(*ends)))
            h = self.leverages(dict(zip(names, corners.T, strict=True)))[row.relation]
            for place in np.argsort(-h)[:NAMED].tolist():
                if h[place] > row.reach:
                    point = ", ".join(map(self._valued, names, corners[place].tolist()))
                    yield f"{row.relation}: {point} (leverage {h[place]:.0f})"

    def _ends(self, name: str) -> tuple[float, float]:
        low, high = self.envelope.ranges.get(name, (0.0, 0.0))
        return (low, high) if name == self.envelope.position else (SLOW * low, SLOW * high)

    def _valued(self, name: str, value: float) -> str:
        unit = self._relations.units_of.get(name, "")
        return f"{name} {value:.3g} {unit}".strip()
