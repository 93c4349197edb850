"""Effect of a fault on the relations: derivatives of what runs, in numbers of one calibration.

An error e of a reading y enters a relation as ``dr/dy * e``, and through the rate of the reading
as ``dr/dy' * de/dt``; a change of a parameter enters as ``dr/dtheta`` times the change, against
its own term. Slow states are held at the description's value: they change an effect by percents.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict

from flea_diag.core.likelihood.fault_models import Term
from flea_diag.core.residuals.parameters import ActuatorParameters
from flea_diag.core.residuals.parity import rate_symbol
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.core.symbolic.collect import collect
from flea_diag.core.symbolic.expression import (
    ONE,
    Constant,
    Expression,
    derivative,
    evaluate,
    substitute,
    total,
)
from flea_diag.errors import ModelError

Gains = tuple[tuple[str, float], ...]
"""Residual and gain."""

REGRESSOR_OF = {
    "1": "one",
    "direction": "direction",
    "motor_current": "motor_current_a",
    "load_force": "load_n",
    "fabs(load_force)*direction": "load_and_direction_n",
    "motor_voltage": "motor_voltage_v",
    "commanded_voltage": "commanded_voltage_v",
    "motor_speed": "speed_m_s",
    "actuator_position": "position_m",
    "d_actuator_position": "position_rate_m_s",
    "load_position": "load_position_m",
}
"""Basis signal of the relations -> regressor of the fault models."""


class Effects:
    """Effects in one set of relations with the parameters of one calibration."""

    def __init__(self, relations: RelationSet, parameters: ActuatorParameters) -> None:
        slow = {name: Constant(value) for name, value in relations.reference.items()}
        self._rows = {
            row.name: (substitute(row.expression, slow), row.signals) for row in relations.relations
        }
        self._values = asdict(parameters)
        self._regressors = dict(REGRESSOR_OF)
        self._scale: dict[str, float] = {}
        if "motor_speed" in relations.signals:
            # The speed counts in m/s at the nut.
            self._scale["motor_speed"] = 1.0 / parameters.encoder_m_per_rad
        else:
            self._regressors["d_actuator_position"] = "speed_m_s"

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the relations."""
        return tuple(self._rows)

    def gains(self, channel: str, unit: float = 1.0) -> Gains:
        """By how much a constant error of a reading moves each relation that reads it.

        ``unit`` is the size of the error that counts as one. What varies with motion in it, such
        as the share of the friction that grows with the load, is left out.
        """
        return self._constant(channel, unit)

    def rates(self, channel: str, unit: float = 1.0) -> Gains:
        """The same of an error that grows by one a second, through the rate of the reading."""
        return self._constant(rate_symbol(channel), unit)

    def _constant(self, symbol: str, unit: float) -> Gains:
        found = []
        for name, (expression, signals) in self._rows.items():
            parts = collect(derivative(expression, symbol), signals)
            gain = unit * float(evaluate(parts.get(ONE, Constant(0.0)), self._values))
            if gain:
                found.append((name, gain))
        return tuple(found)

    def lost(self, amounts: Mapping[str, float], index: int = 0) -> tuple[Term, ...]:
        """Terms of parameters that are smaller by these amounts for each unit of the fault's size.

        What the parameter lacks is left of its own term in the relation.
        """
        found: list[Term] = []
        for name, (expression, signals) in self._rows.items():
            effect = total(
                Constant(amount) * derivative(expression, parameter)
                for parameter, amount in amounts.items()
            )
            found += self._terms(name, effect, signals, index)
        return tuple(found)

    def _terms(
        self, residual: str, effect: Expression, signals: tuple[str, ...], index: int
    ) -> list[Term]:
        found = []
        for basis, coefficient in collect(effect, signals).items():
            signal = str(basis)
            if signal not in self._regressors:
                raise ModelError(f"{residual}: no regressor follows {signal}; add it")
            gain = float(evaluate(coefficient, self._values)) * self._scale.get(signal, 1.0)
            if gain:
                found.append(Term(residual, self._regressors[signal], gain, index))
        return found
