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

"""Fault signatures at the scan rate, from the discretised, linearised model.

The electromechanical time constants lie below the scan period, so the initial signs of
current and speed vanish between two scans: the first sample already shows the quasi-static
effect. Each cell is the residual's response 1, 5, 100 and 3000 scans after the onset, exact for
inputs held over a scan, compared with the sensor's noise.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from flea_diag.core.bond_graph.actuator_model import Actuator, ResidualSpec
from flea_diag.core.bond_graph.discretisation import expm
from flea_diag.core.bond_graph.state_space import StateSpace
from flea_diag.core.causal_graph.operating_point import rates
from flea_diag.core.faults.fault import Alternative, Fault, FaultHypothesis
from flea_diag.core.faults.fault_signature import UNAFFECTED, FaultSignature, signature
from flea_diag.core.residuals.parity import ParityRelation, parity_relation
from flea_diag.core.signatures.parity_signature import VISIBLE_SHARE, parity_cell, sensor_signs

Array = npt.NDArray[np.float64]

SCANS = (1, 5, 100, 3000)
"""Scans after the onset at which the response is read: at 100 Hz, 10 ms, 50 ms, 1 s, 30 s."""

VISIBLE_SIGMA = (0.3, 0.3, 0.3, 0.05)
"""Smallest visible mean at each of them, in sigmas of a sample: about ten scans are averaged at
first, some hundred after half a minute."""

DIVERGED = 1e12
"""A state beyond this magnitude has diverged."""

LARGEST = 2.0
"""Largest relative change of a parameter; a fault may exceed its reference size up to it."""

SYMBOL_OF = {1: "+", -1: "-", 0: "0"}


@dataclass(frozen=True)
class ResidualResponse:
    """Response of one residual at ``SCANS``, in its unit, and the noise of its sensors.

    ``reach`` is the largest size of the fault relative to its reference size. An effect that is
    visible only beyond the reference size keeps its sign, without a jump; one that is not visible
    at any size is no effect.
    """

    values: tuple[float, ...]
    sigma: float
    reach: float = 1.0

    def signature(self, cause: str) -> FaultSignature:
        """Magnitude at the first scan, slope from there to the end of the first second."""
        floors = [share * self.sigma for share in VISIBLE_SIGMA]
        seen = self._signs(floors)
        signs = seen if any(seen) else self._signs([floor / self.reach for floor in floors])
        if not any(signs):
            return UNAFFECTED
        words = "/".join(SYMBOL_OF[s] for s in signs)
        path = f"{cause}: {words} after {', '.join(map(str, SCANS))} scans"
        strength = max(map(abs, self.values[:-1])) / self.sigma
        if not seen[0]:
            found = signature("0" + SYMBOL_OF[next(s for s in signs if s)], path)
        else:
            found = signature(SYMBOL_OF[seen[0]] + self._slope(floors[0] / self.reach), path)
        return replace(found, strength=strength)

    def _signs(self, floors: list[float]) -> list[int]:
        gone = VISIBLE_SHARE * max(map(abs, self.values))
        pairs = zip(self.values, floors, strict=True)
        return [int(np.sign(v)) if abs(v) >= max(floor, gone) else 0 for v, floor in pairs]

    def _slope(self, floor: float) -> str:
        change = self.values[2] - self.values[0]
        moved = abs(change) > max(floor, 0.1 * abs(self.values[0]))
        return SYMBOL_OF[int(np.sign(change))] if moved else "0"


class SampledColumns:
    """Cells of the sampled table of one actuator at one operating point."""

    def __init__(self, model: Actuator, values: Mapping[str, float], period_s: float) -> None:
        self.model = model
        self.values = dict(values)
        self.period_s = period_s
        self.rates = rates(model, self.values)
        self.views: dict[str, StepResponse] = {}
        self.relations: dict[str, ParityRelation] = {}

    def cell(self, spec: ResidualSpec, fault: Fault, group: Alternative) -> FaultSignature:
        """Signature of one alternative in one residual."""
        if spec.balances or spec.across or spec.supplied_by:
            relation = self._relation(spec)
            return parity_cell(relation, fault, group, self.values, self.rates)
        senses = {spec.channel: 1}
        if spec.kind == "difference":
            senses[spec.reference] = -1
        senses = {c: sense for c, sense in senses.items() if c in self.model.sensors}
        if group and group[0].mode:
            found = self._sensor_cell(senses, spec.model or "stand", group[0])
            steady = group[0].mode == "scaling" and not self.rates.get(group[0].name)
            # A share of a reading that stands here comes and goes with it elsewhere.
            return _varying(found) if steady and spec.kind == "difference" else found
        changed, reach = self._changed(fault, group), max(1.0, LARGEST / fault.size)
        moved = self._deviation(senses, spec.model or "stand", changed, reach)
        result = moved.signature(", ".join(map(str, group)))
        if fault.incipient:
            return _grown(result)
        # Two readings of one thing come apart by what moves them: with the motion, or a command.
        return _varying(result) if spec.kind == "difference" else result

    def _sensor_cell(
        self, senses: Mapping[str, int], view: str, cause: FaultHypothesis
    ) -> FaultSignature:
        if cause.name in senses:
            signed = FaultHypothesis(cause.name, cause.direction * senses[cause.name], cause.mode)
            signs = sensor_signs(signed, self.values[cause.name], self.rates.get(cause.name, 0.0))
            return signature(signs, f"{cause} -> {', '.join(senses)}")
        if cause.name not in self.view(view).model.inputs:
            return UNAFFECTED
        # The prediction follows the faulty reading, so y - prediction moves against it.
        error = -cause.direction * self._error(cause)
        changed = {cause.name: self.values[cause.name] + error}
        found = self._deviation(senses, view, changed).signature(str(cause))
        return _IN_MODE.get(cause.mode, lambda same: same)(found)

    def _deviation(
        self,
        senses: Mapping[str, int],
        view: str,
        changed: Mapping[str, float],
        reach: float = 1.0,
    ) -> ResidualResponse:
        model = self.view(view)
        response = sum(s * model.response(c, changed) for c, s in senses.items())
        sigma = math.hypot(*(self.model.sensors[c].noise for c in senses))
        return ResidualResponse(tuple(np.broadcast_to(response, len(SCANS)).tolist()), sigma, reach)

    def _changed(self, fault: Fault, group: Alternative) -> dict[str, float]:
        """Values that the fault changes: grown by its size, or fallen, never through zero."""
        result = {}
        for cause in group:
            value, size = self.values.get(cause.name, 0.0), fault.size
            if cause.name in self.model.inputs:
                result[cause.name] = value + cause.direction * size * (abs(value) or 1.0)
            elif cause.direction > 0:
                result[cause.name] = value * (1 + size)
            else:
                result[cause.name] = value * (1 - size if size < 1 else 1 / (1 + size))
        return result

    def _error(self, cause: FaultHypothesis) -> float:
        """A plain error of a sensor: ten sigma, or a tenth of what it reads."""
        value = self.values[cause.name]
        size = max(10 * self.model.sensors[cause.name].noise, 0.1 * abs(value))
        return size * float(np.sign(value)) if cause.mode == "scaling" else size

    def view(self, name: str) -> StepResponse:
        """How a view of the model leaves the operating point."""
        if name not in self.views:
            model = self.model.state_space(name)
            self.views[name] = StepResponse(model, self.values, self.period_s)
        return self.views[name]

    def _relation(self, spec: ResidualSpec) -> ParityRelation:
        if spec.name not in self.relations:
            self.relations[spec.name] = parity_relation(self.model, spec)
        return self.relations[spec.name]


def _grown(found: FaultSignature) -> FaultSignature:
    """The same effect of a fault that grows from nothing: no jump, a slope of its first sign."""
    if not found.affected:
        return found
    first = found.magnitude if found.magnitude != "0" else found.slope
    return replace(signature("0" + first, found.path), strength=found.strength)


def _varying(found: FaultSignature) -> FaultSignature:
    """The same effect of a fault that acts through a signal: it comes and goes as that does."""
    if not found.affected or found.magnitude == "0":
        return found
    return replace(signature(found.magnitude + "*", found.path), strength=found.strength)


def _open(found: FaultSignature) -> FaultSignature:
    return signature("**", found.path) if found.affected else found


_IN_MODE = {"drift": _grown, "noise": _open, "dropout": _open}


class StepResponse:
    """One view of the model about one point: how it leaves it when values change."""

    def __init__(self, model: StateSpace, values: Mapping[str, float], period_s: float) -> None:
        self.model = model
        self.values = values
        self.period_s = period_s
        self.known: dict[tuple[tuple[str, float], ...], Array] = {}
        self.still = self._outputs(values)

    def response(self, channel: str, changed: Mapping[str, float]) -> Array:
        """Deviation of one channel at SCANS after a finite change of parameters or inputs."""
        if channel not in self.model.outputs or not changed:
            return np.zeros(len(SCANS))
        key = tuple(sorted(changed.items()))
        if key not in self.known:
            self.known[key] = self._outputs({**self.values, **changed}) - self.still
        column: Array = self.known[key][:, self.model.outputs.index(channel)]
        return column

    def _outputs(self, values: Mapping[str, float]) -> Array:
        """Outputs at SCANS, shape (scans, q): linearised dynamics, the changed values in full.

        The dynamics are those of the changed plant, not the nominal one: an open winding
        changes the time constants themselves.
        """
        model = self.model
        x = np.array([values[name] for name in model.states])
        u = np.array([values[name] for name in model.inputs])
        p = np.array([values[name] for name in model.parameters])
        n = len(x)
        rates = np.zeros((n + 1, n + 1))
        rates[:n, :n], rates[:n, n] = model.linearise(x, u, p).a, model.derivatives(x, u, p)
        scan = expm(rates * self.period_s)
        seen = [model.measure(x + gone, u, p) for gone in _powers(scan, n)]
        return np.array(seen)


def _powers(scan: Array, n: int) -> list[Array]:
    """Way gone at SCANS; a plant that a fault makes unstable stays where it last was finite."""
    ways: list[Array] = []
    with np.errstate(over="ignore", invalid="ignore"):
        for scans in SCANS:
            way = np.linalg.matrix_power(scan, scans)[:n, n]
            ways.append(way if np.all(np.abs(way) < DIVERGED) else ways[-1] if ways else 0.0 * way)
    return ways
