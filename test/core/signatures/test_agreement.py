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

"""Signs from the graph are those of the relations that run: cell by cell, in every quadrant."""

from __future__ import annotations

from collections.abc import Mapping
from types import SimpleNamespace

import numpy as np
import pytest

from flea_diag.configuration.description import compiled_relations, described, faults_of
from flea_diag.configuration.stand import load_stand
from flea_diag.core.bond_graph.actuator import Actuator
from flea_diag.core.causal_graph.operating_point import QUADRANTS, Quadrant, operating_values
from flea_diag.core.faults.fault import Alternative
from flea_diag.core.residuals.measured_graph import channel_of, rate_symbol
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.core.residuals.residual_rows import Parity
from flea_diag.core.signatures.signature import signature_table
from flea_diag.core.symbolic.expression import evaluate

STEP = 1e-4
QUIET = 1e-12
MILLIMETRE = 1e-3
ADDED = ("bias", "drift")


def point_of(model: Actuator, known: RelationSet, values: Mapping[str, float]) -> dict[str, float]:
    """Signals at an operating point; a displacement moves with the flow that it is read of."""
    found = {}
    for name in known.signals:
        if name in known.shapes:
            continue  # of the other signals
        channel, order = channel_of(name)
        if name in known.reference:
            found[name] = known.reference[name]
        elif order == 0:
            found[name] = values[channel]
        else:
            found[name] = values[model.variable(channel)] if order == 1 else 0.0
    return found


def moved(
    model: Actuator, point: Mapping[str, float], group: Alternative
) -> tuple[dict[str, float], dict[str, float]]:
    """Parameters of the graph and signals with a small fault.

    The relation of a plant that has changed is zero; with the parameters of before it is what these
    are off by, the other way.
    """
    parameters, signals = model.graph.values(), dict(point)
    for cause in group:
        by = STEP * cause.direction
        if cause.mode == "":
            old = parameters[cause.name]
            parameters[cause.name] = old - by * (abs(old) or 1.0)
        for name in (cause.name, rate_symbol(cause.name)):
            if cause.mode == "scaling" and name in signals:
                signals[name] *= 1.0 + by
        if cause.mode in ADDED:
            # A drift has its rate at once, and its value after a moment.
            rate, age = rate_symbol(cause.name), 1e-3 if cause.mode == "drift" else 1.0
            signals[cause.name] = signals.get(cause.name, 0.0) + age * by
            if cause.mode == "drift":
                signals[rate] = signals.get(rate, 0.0) + by
    return parameters, signals


def values_of(
    known: RelationSet, parameters: Mapping[str, float], signals: Mapping[str, float]
) -> np.ndarray:
    base = {n: float(evaluate(e, parameters)) for n, e in known.base.items()}
    for name, shape in known.shapes.items():
        signals = {**signals, name: float(evaluate(shape, {**base, **signals}))}
    x = [signals[name] for name in known.signals]
    return np.array(known.functions["relations"](SimpleNamespace(**base), x), dtype=float)


def signs(
    known: RelationSet, model: Actuator, point: Mapping[str, float], group: Alternative
) -> list[int]:
    """How each relation that runs moves, as a sign."""
    healthy = values_of(known, model.graph.values(), point)
    change = values_of(known, *moved(model, point, group)) - healthy
    least = np.array([MILLIMETRE if row.unit == "m" else 1.0 for row in known.relations])
    scale = np.abs(healthy) + least
    return [
        0 if abs(c) < QUIET * s else int(np.sign(c)) for c, s in zip(change, scale, strict=True)
    ]


def told(row: Parity, sign: int, quadrant: Quadrant) -> str:
    turned = sign * quadrant.speed if row.normalised else sign
    return {0: "0", 1: "+", -1: "-"}[turned]


@pytest.mark.slow
@pytest.mark.parametrize("stand", ["flea", "ema", "wing", "cranfield", "joint"])
def test_every_cell_is_the_sign_of_what_runs(stand: str) -> None:
    files = load_stand(stand)
    model, known = described(files.actuator), compiled_relations(files.actuator)
    faults = faults_of(files.actuator, files.faults)
    parities = [p for p in known.residuals.parities if model.residuals[p.name].signs]
    compared = 0
    for quadrant in QUADRANTS:
        names = [p.name for p in parities]
        values = operating_values(model, quadrant)
        assert np.sign(values["motor_current"]) == quadrant.current
        point = point_of(model, known, values)
        table = signature_table(model, faults, names, quadrant, model.scan_period_s)
        for fault, variants in table.variants.items():
            for variant in variants:
                if {cause.mode for cause in variant.hypotheses} - {"", "scaling", *ADDED}:
                    continue
                of_plant = "" in {cause.mode for cause in variant.hypotheses}
                found = signs(known, model, point, variant.hypotheses)
                for parity in parities:
                    # What lies between two sensors is in the response of the graph alone.
                    if of_plant and model.residuals[parity.name].kind == "difference":
                        continue
                    shown = variant.row[parity.name].direction
                    if shown == "*":
                        continue
                    sign = found[known.names.index(parity.relation)]
                    assert told(parity, sign, quadrant) == shown, (
                        fault,
                        parity.name,
                        str(quadrant),
                    )
                    compared += shown != "0"
    assert compared > 20
