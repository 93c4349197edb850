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

"""Fault catalogue: each fault id as deviations of parameters and sensors.

A fault is a set of alternatives; an alternative is a set of simultaneous deviations.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, Any

from flea_diag.core.bond_graph.actuator_model import Actuator
from flea_diag.core.faults.effect_row import UNBOUNDED, EffectRow, ErrorRow, effect_rows, error_rows
from flea_diag.core.faults.response import UNSTATED, Response, completed
from flea_diag.errors import ConfigurationError, shown
from flea_diag.fields.reader import read_as
from flea_diag.fields.values import AboveZero, one_of
from flea_diag.formats import migrated

MODES = ("bias", "drift", "scaling", "dead", "noise", "dropout")
APPROACHES = ("physics", "data", "hybrid")
ONSETS = ("abrupt", "incipient", "any")
SIGN = {"+": 1, "-": -1}


@dataclass(frozen=True)
class FaultHypothesis:
    """One deviation: an increase or decrease of a parameter or input, or a sensor fault mode.

    Prints as ``winding_resistance+`` or ``motor_current_bias-``.
    """

    name: str
    direction: int
    mode: str = ""

    def __str__(self) -> str:
        return f"{self.label}{'+' if self.direction > 0 else '-'}"

    @property
    def label(self) -> str:
        """The name without its direction."""
        return f"{self.name}_{self.mode}" if self.mode else self.name


def hypothesis(words: str, where: str = "hypothesis") -> FaultHypothesis:
    """Read ``winding_resistance+``."""
    if not words or words[-1] not in SIGN:
        raise ConfigurationError(
            f"{where}: {shown(words)} must end in + or -, the direction of change"
        )
    return FaultHypothesis(words[:-1], SIGN[words[-1]])


Alternative = tuple[FaultHypothesis, ...]


@dataclass(frozen=True)
class Impacts:
    """Impacts by which a fault is followed where relations give it no size, as a spall.

    ``limit``: their amplitude at the end of life, m/s^2 as ``flea trend`` states it.
    """

    accelerometer: str
    limit: AboveZero = math.inf


@dataclass(frozen=True)
class Fault:
    """One row of the catalogue.

    ``alternatives`` is empty for a fault that shows only in vibration. ``size`` is the reference
    size of the fault, a relative change of its parameters. ``effects`` say how large it may be, and
    what that does to the parameters; ``errors`` the same of a fault of a sensor.
    ``response`` is what people do about it. ``impacts`` size it by vibration; ``sized_by`` says
    what else would, where the channels of the stand do not.
    """

    name: str
    component: str
    alternatives: tuple[Alternative, ...]
    approach: str
    onset: str
    size: float
    vibration: bool
    excitation: str
    channel: str = ""
    mode: str = ""
    effects: tuple[EffectRow, ...] = ()
    errors: ErrorRow = UNBOUNDED
    response: Response = UNSTATED
    impacts: Impacts | None = None
    sized_by: str = ""

    @property
    def deviation(self) -> str:
        """The deviating parameters, or the sensor mode, with directions."""
        groups = (", ".join(map(str, group)) for group in self.alternatives)
        return " | ".join(groups) or "vibration only"

    @property
    def incipient(self) -> bool:
        """Whether the fault grows from zero."""
        return self.onset == "incipient"

    @property
    def onsets(self) -> tuple[Fault, ...]:
        """The fault for each possible onset: itself, or one abrupt and one incipient."""
        if self.onset != "any":
            return (self,)
        return (replace(self, onset="abrupt"), replace(self, onset="incipient"))


@dataclass(frozen=True)
class _FaultRow:
    """A fault as the catalogue describes it."""

    component: str
    hypotheses: tuple[tuple[str, ...], ...]
    approach: Annotated[str, one_of(*APPROACHES)]
    onset: Annotated[str, one_of(*ONSETS)]
    size: AboveZero = 0.2
    vibration: bool = False
    excitation: str = ""
    effects: tuple[Any, ...] = ()
    response: Response = UNSTATED
    impacts: Impacts | None = None
    sized_by: str = ""


@dataclass(frozen=True)
class _SensorMode:
    """A fault of every sensor."""

    approach: Annotated[str, one_of(*APPROACHES)]
    onset: Annotated[str, one_of(*ONSETS)]
    excitation: str = ""
    response: Response = UNSTATED


@dataclass(frozen=True)
class _CatalogueFile:
    faults: Mapping[str, _FaultRow]
    sensor_modes: Mapping[str, _SensorMode] = field(default_factory=dict)
    sensor_errors: Mapping[str, Any] = field(default_factory=dict)


def catalogue(content: Any, actuator: Actuator, where: str = "faults.yaml") -> dict[str, Fault]:
    """Fault by id: every row of the description, and each mode of each sensor.

    Raises
    ------
    ConfigurationError
        A row names an unknown parameter, mode or keyword.
    """
    top = read_as(_CatalogueFile, migrated("fault catalogue", content, where), where)
    found = {
        name: _fault(name, row, actuator, f"{where}: fault {shown(name)}")
        for name, row in top.faults.items()
    }
    errors = error_rows(top.sensor_errors, actuator, f"{where}: sensor_errors")
    for mode in top.sensor_modes:
        if mode not in MODES:
            raise ConfigurationError(
                f"{where}: sensor mode {shown(mode)} is unknown, known are {', '.join(MODES)}"
            )
    for channel in actuator.sensors:
        for mode, row in top.sensor_modes.items():
            made = _sensor_fault(channel, mode, row)
            found[made.name] = replace(made, errors=errors.get(channel, UNBOUNDED))
    return found


def of_sensors(faults: Mapping[str, Fault], channels: Collection[str]) -> dict[str, Fault]:
    """The catalogue without the faults of sensors that are not among these channels."""
    return {
        n: fault for n, fault in faults.items() if not fault.channel or fault.channel in channels
    }


def _fault(name: str, row: _FaultRow, actuator: Actuator, where: str) -> Fault:
    alternatives = tuple(
        tuple(hypothesis(words, where) for words in group) for group in row.hypotheses
    )
    known = {*actuator.graph.parameters, *actuator.inputs}
    for each in (h for group in alternatives for h in group):
        if each.name not in known:
            raise ConfigurationError(
                f"{where}: {each} is no parameter or input of {actuator.name},"
                f" known are {', '.join(sorted(known))}"
            )
    effects = effect_rows(row.effects, actuator, where)
    return Fault(
        name,
        row.component,
        alternatives,
        row.approach,
        row.onset,
        row.size,
        row.vibration,
        row.excitation,
        effects=effects,
        response=completed(row.response, name, row.component, row.onset, row.excitation, ""),
        impacts=row.impacts,
        sized_by=row.sized_by,
    )


def _sensor_fault(channel: str, mode: str, row: _SensorMode) -> Fault:
    return Fault(
        f"{channel}_{mode}",
        component=f"sensor {channel}",
        alternatives=tuple((FaultHypothesis(channel, way, mode),) for way in (1, -1)),
        approach=row.approach,
        onset=row.onset,
        size=0.2,
        vibration=False,
        excitation=row.excitation,
        channel=channel,
        mode=mode,
        response=completed(
            row.response,
            f"{channel}_{mode}",
            f"sensor {channel}",
            row.onset,
            row.excitation,
            channel,
        ),
    )
