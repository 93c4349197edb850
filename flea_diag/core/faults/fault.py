"""Fault catalogue: each fault id as deviations of parameters and sensors.

A fault is a set of alternatives; an alternative is a set of simultaneous deviations.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Any

from flea_diag.core import schema
from flea_diag.core.bond_graph.actuator_model import Actuator
from flea_diag.core.faults.effect_row import UNBOUNDED, EffectRow, ErrorRow, effect_rows, error_rows
from flea_diag.core.schema import REQUIRED
from flea_diag.errors import ConfigurationError, shown
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
class Fault:
    """One row of the catalogue.

    ``alternatives`` is empty for a fault that shows only in vibration. ``size`` is the reference
    size of the fault, a relative change of its parameters. ``effects`` say how large it may be, and
    what that does to the parameters; ``errors`` the same of a fault of a sensor.
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


_FAULT: schema.Keys = {
    "component": (str, REQUIRED),
    "hypotheses": (list, REQUIRED),
    "approach": (str, REQUIRED),
    "onset": (str, REQUIRED),
    "size": (float, 0.2),
    "vibration": (bool, False),
    "excitation": (str, ""),
    "effects": (list, []),
}
_MODE: schema.Keys = {
    "approach": (str, REQUIRED),
    "onset": (str, REQUIRED),
    "excitation": (str, ""),
}
_TOP: schema.Keys = {
    "faults": (dict, REQUIRED),
    "sensor_modes": (dict, {}),
    "sensor_errors": (dict, {}),
}


def catalogue(content: Any, actuator: Actuator, where: str = "faults.yaml") -> dict[str, Fault]:
    """Fault by id: every row of the description, and each mode of each sensor.

    Raises
    ------
    ConfigurationError
        A row names an unknown parameter, mode or keyword.
    """
    top = schema.read(migrated("fault catalogue", content, where), where, _TOP)
    found = {
        name: _fault(name, row, actuator, f"{where}: fault {shown(name)}")
        for name, row in schema.rows(top["faults"], f"{where}: faults").items()
    }
    modes = schema.rows(top["sensor_modes"], f"{where}: sensor_modes")
    errors = error_rows(top["sensor_errors"], actuator, f"{where}: sensor_errors")
    for channel in actuator.sensors:
        for mode, row in modes.items():
            name = f"{channel}_{mode}"
            made = _sensor_fault(name, channel, mode, row, f"{where}: sensor mode {shown(mode)}")
            found[name] = replace(made, errors=errors.get(channel, UNBOUNDED))
    return found


def of_sensors(faults: Mapping[str, Fault], channels: Collection[str]) -> dict[str, Fault]:
    """The catalogue without the faults of sensors that are not among these channels."""
    return {
        n: fault for n, fault in faults.items() if not fault.channel or fault.channel in channels
    }


def _fault(name: str, row: Any, actuator: Actuator, where: str) -> Fault:
    values = schema.read(row, where, _FAULT)
    _check_words(values, where)
    if not values["size"] > 0:
        raise ConfigurationError(f"{where}: size = {values['size']} must be > 0")
    alternatives = tuple(
        tuple(hypothesis(words, where) for words in schema.texts(group, f"{where}: hypotheses"))
        for group in values.pop("hypotheses")
    )
    known = {*actuator.graph.parameters, *actuator.inputs}
    for each in (h for group in alternatives for h in group):
        if each.name not in known:
            raise ConfigurationError(
                f"{where}: {each} is no parameter or input of {actuator.name},"
                f" known are {', '.join(sorted(known))}"
            )
    effects = effect_rows(values.pop("effects"), actuator, where)
    return Fault(name, alternatives=alternatives, effects=effects, **values)


def _sensor_fault(name: str, channel: str, mode: str, row: Any, where: str) -> Fault:
    values = schema.read(row, where, _MODE)
    _check_words(values, where)
    if mode not in MODES:
        raise ConfigurationError(f"{where} is unknown, known are {', '.join(MODES)}")
    both = tuple((FaultHypothesis(channel, direction, mode),) for direction in (1, -1))
    return Fault(
        name,
        component=f"sensor {channel}",
        alternatives=both,
        approach=values["approach"],
        onset=values["onset"],
        size=0.2,
        vibration=False,
        excitation=values["excitation"],
        channel=channel,
        mode=mode,
    )


def _check_words(values: Mapping[str, Any], where: str) -> None:
    for key, known in (("approach", APPROACHES), ("onset", ONSETS)):
        if values[key] not in known:
            raise ConfigurationError(
                f"{where}: {key} = {shown(values[key])} is unknown, known are {', '.join(known)}"
            )
