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

"""Signatures without a model run: sensors in their own reading, faults in parity relations."""

from __future__ import annotations

from collections.abc import Mapping

from flea_diag.core.causal_graph.operating_point import sign_of
from flea_diag.core.causal_graph.propagation import SYMBOL, combined, scaled
from flea_diag.core.faults.fault import Alternative, Fault, FaultHypothesis
from flea_diag.core.faults.fault_signature import FaultSignature, signature
from flea_diag.core.residuals.measured_graph import channel_of, rate_symbol
from flea_diag.core.residuals.parity import ParityRelation
from flea_diag.core.symbolic.collect import collect
from flea_diag.core.symbolic.expression import (
    ONE,
    ZERO,
    Expression,
    Variable,
    derivative,
    evaluate,
)

VISIBLE_SHARE = 0.05
"""A part below this share of the rest counts as zero."""


def sensor_signs(cause: FaultHypothesis, value: float, rate: float) -> str:
    """Signs of what a sensor fault adds to its own reading, order 0 and 1.

    Scaling by s adds (s - 1) y. A dead sensor reads an unknown constant, above
    or below the truth (both alternatives are held), and moves as the truth does. Noise and
    drop-outs move no mean, and refute nothing.
    """
    own = SYMBOL[cause.direction]
    return {
        "dead": own + "*",
        "bias": own + "0",
        "drift": "0" + own,
        "scaling": scaled(own, sign_of(value)) + scaled(own, sign_of(rate)),
    }.get(cause.mode, "**")


def parity_cell(
    relation: ParityRelation,
    fault: Fault,
    group: Alternative,
    values: Mapping[str, float],
    rate_of: Mapping[str, float],
) -> FaultSignature:
    """Signature of a fault in a parity relation: the sign of its regressor.

    The relation is algebraic, so an abrupt fault shows at once and stays as long as its
    regressor does: slope 0 when that is constant, open (``*``) when it varies with motion.
    """
    point = {**_readings(relation, values, rate_of), **relation.nominal}
    cells = [_regressor_signs(relation, fault, cause, point) for cause in group]
    signs = "".join(combined(parts) for parts in zip(*cells, strict=True))
    names = ", ".join(map(str, group))
    return signature(signs, f"{names} -> {relation.name}")


def _readings(
    relation: ParityRelation, values: Mapping[str, float], rate_of: Mapping[str, float]
) -> dict[str, float]:
    point: dict[str, float] = {}
    for name in relation.arguments:
        channel, order = channel_of(name)
        by_order = (values[channel], rate_of.get(channel, 0.0), 0.0)
        point[name] = by_order[min(order, 2)]
    return point


def _regressor_signs(
    relation: ParityRelation, fault: Fault, cause: FaultHypothesis, point: Mapping[str, float]
) -> str:
    if cause.mode in ("noise", "dropout"):
        return "**" if cause.name in relation.channels else "00"
    if cause.mode and cause.name in relation.sided:
        return "**"  # the reading may be on the other side, wherever that is
    if cause.mode == "dead":
        return _dead_signs(relation, cause, point)
    effect = relation.regressor(cause)
    now = _regressor_sign(effect, cause, point)
    if cause.mode == "drift":
        return now + _later(relation, relation.growth(cause), cause, point)
    if cause.mode == "" and fault.incipient:
        return "0" + now
    return now + ("*" if now != "0" and _varies(relation, effect, point) else "0")


def _later(
    relation: ParityRelation, growth: Expression, cause: FaultHypothesis, point: Mapping[str, float]
) -> str:
    """Slope of an effect that grows by ``growth``: open where motion makes it come and go."""
    sign = _regressor_sign(growth, cause, point)
    return "*" if sign != "0" and _varies(relation, growth, point) else sign


def _varies(relation: ParityRelation, effect: Expression, point: Mapping[str, float]) -> bool:
    """Whether an effect changes with motion, by more than ``VISIBLE_SHARE`` of what is constant.

    A part that is zero at this point may be large at others.
    """
    parts = [
        (basis, float(evaluate(basis, point)), float(evaluate(coefficient, point)))
        for basis, coefficient in collect(effect, relation.arguments).items()
    ]
    constant = sum(abs(factor) for basis, _, factor in parts if basis == ONE)
    return any(
        basis != ONE and factor and (not now or abs(now * factor) > VISIBLE_SHARE * constant)
        for basis, now, factor in parts
    )


def _dead_signs(
    relation: ParityRelation, cause: FaultHypothesis, point: Mapping[str, float]
) -> str:
    """A reading that stops: off by an unknown constant of the given sign, and rate zero."""
    level = _regressor_sign(derivative(relation.expression, cause.name), cause, point)
    rate = rate_symbol(cause.name)
    lost = -derivative(relation.expression, rate) * Variable(rate)
    stopped = FaultHypothesis(cause.name, 1, cause.mode)
    now = combined((level, _regressor_sign(lost, stopped, {rate: 0.0, **point})))
    return now + ("*" if now != "0" else "0")


def _regressor_sign(effect: Expression, cause: FaultHypothesis, point: Mapping[str, float]) -> str:
    if effect == ZERO:
        return "0"
    return SYMBOL[cause.direction * sign_of(float(evaluate(effect, point)))]
