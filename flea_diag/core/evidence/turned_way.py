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

"""What an error of the current does by the way that the current is taken to go.

A bridge loses a voltage by the way of its current. The law, and a relation that names the bridge,
take this way from the reading: an error that turns the sign of the reading turns it as well, as a
bias does at rest. How large the error is in a window the circuit tells, in which it acts by the
resistance. What a turned sign adds is no share of the error; and near no current a bridge loses
less than the sign says, so it is any share of that, from 0 to 1. What else the law takes from the
reading changes in proportion, by less than any model of a fault is off by; and the zero of another
unit is as small as a current whose way is hardly known.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial

import numpy as np
import numpy.typing as npt

from flea_diag.core.evidence.stream_windows import LawWindow
from flea_diag.core.frozen import Frozen
from flea_diag.core.likelihood.effect_set import EffectSet
from flea_diag.core.likelihood.effects import EffectRules
from flea_diag.core.residuals.parameters import ActuatorParameters
from flea_diag.core.run_law.run_windows import CURRENT_WAY, current_side, signal_names
from flea_diag.core.symbolic.expression import Function, derivative, evaluate

Array = npt.NDArray[np.float64]
Way = Callable[[Array], Array]


@dataclass(frozen=True, eq=False)
class TurnedWay(Frozen):
    """Of one stand.

    Attributes
    ----------
    channel, current
        The reading of the current, and its place among the signals.
    circuit, gain
        Place of the relation that tells its error, and what an error of 1 A adds there, V / A.
    ways
        Places of the signals that are the way of the current, each with what makes it of a current.
    held
        What the relations themselves hold of these signals, shape (relations, signals).
    """

    channel: str
    current: int
    circuit: int
    gain: float
    ways: tuple[tuple[int, Way], ...]
    held: Array

    @classmethod
    def of(
        cls, effects: EffectSet, parameters: ActuatorParameters, relations: Sequence[str]
    ) -> TurnedWay | None:
        """Of these relations; None where no circuit reads the current."""
        rows, names, values = effects.residuals, signal_names(effects), asdict(parameters)
        gains = dict(EffectRules(effects.relations).gains(rows.current)) if rows.current else {}
        if rows.circuit not in relations or rows.circuit not in gains:
            return None
        gain = float(evaluate(gains[rows.circuit], values))
        ways: list[tuple[int, Way]] = [(names.index(CURRENT_WAY), np.sign)]
        held = np.zeros((len(relations), len(names)))
        side = current_side(effects)
        if side:
            shape = effects.relations.shapes[side]
            ways.append((names.index(side), partial(_side, shape, rows.current, values)))
            for row in effects.relations.relations:
                if row.name in relations and side in row.signals:
                    share = float(evaluate(derivative(row.expression, side), values))
                    held[relations.index(row.name), names.index(side)] = share
        current, circuit = names.index(rows.current), relations.index(rows.circuit)
        return cls(rows.current, current, circuit, gain, tuple(ways), held)

    def added(self, window: LawWindow, left: Array, share: Array, law: Array) -> Array:
        """What a full turn of the way adds to each relation, shape (relations,).

        0 where the error that the circuit tells leaves the sign of the reading what it is.

        Parameters
        ----------
        left
            Of the relations beside the law, in their units, shape (relations,).
        share
            How much of that is no noise, 0 to 1, same shape.
        law
            What this recording has of each signal, shape (relations, signals).
        """
        error = share[self.circuit] * left[self.circuit] / self.gain
        read = window.read[:, self.current]
        every = [(law - self.held)[:, k] * (way(read - error) - way(read)) for k, way in self.ways]
        return np.asarray(sum(every))


def _side(shape: Function, name: str, values: dict[str, float], current: Array) -> Array:
    """The smooth way of the current of a bridge that the description names."""
    return np.asarray(evaluate(shape, {**values, name: current}))
