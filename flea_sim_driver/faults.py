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

"""Fault catalogue of a simulated machine: effect, place and size of each fault.

A new fault is a row of ``PLANT_FAULTS`` and a small function from coefficients and size to
coefficients. Which faults a machine can have, and at which sizes, stands in its file. Sensor faults
of every channel and mode follow from its ``sensor_faults``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache, partial
from types import MappingProxyType
from typing import Any

from flea_diag.errors import ConfigurationError, shown
from flea_sim_driver.machine.machine import Machine
from flea_sim_driver.machine.machine_file import numbers_of
from flea_sim_driver.plant.plant import Coefficients

Change = Callable[[Coefficients, float], Coefficients]


@dataclass(frozen=True)
class FaultRow:
    """One row: ``size`` is in ``size_unit``; ``places`` begins with the default one.

    Places: ``plant`` (hardware), ``daq`` (the digital value recorded, not that of the control
    loop), ``loop`` (the sensor read by the control loop).
    """

    id: str
    title: str
    places: tuple[str, ...]
    default_size: float
    minimum: float
    maximum: float
    size_unit: str
    approach: str
    change: Change | None = None
    channel: str = ""
    mode: str = ""


Numbers = Mapping[str, float]


def _jam(c: Coefficients, size: float, own: Numbers) -> Coefficients:
    """Drag of a jammed unit at size 1: dry, growing with speed, and growing with the load."""
    return c._replace(
        coulomb=c.coulomb + own["coulomb_n"] * size,
        viscous=c.viscous + own["viscous_n_s_m"] * size,
        load_friction=c.load_friction + own["load_friction"] * size,
    )


def _ball_nut_friction(c: Coefficients, size: float, own: Numbers) -> Coefficients:
    """Failed lubrication: viscous drag grows by ``size`` times its nominal value."""
    return c._replace(
        viscous=c.viscous * (1.0 + size), coulomb=c.coulomb * (1.0 + own["dry_share"] * size)
    )


def _spall(c: Coefficients, size: float, own: Numbers) -> Coefficients:
    """Balls passing a pit: a zero-mean force ripple at ball pass and hardly any drag."""
    return c._replace(spall=own["ripple_n"] * size, coulomb=c.coulomb + own["coulomb_n"] * size)


def _backlash(c: Coefficients, size: float, _own: Numbers) -> Coefficients:
    return c._replace(backlash=c.backlash + size)


def _rotor_eccentricity(c: Coefficients, size: float, own: Numbers) -> Coefficients:
    return c._replace(eccentric=c.eccentric + own["ripple_n"] * size)


def _winding_short(c: Coefficients, size: float, _own: Numbers) -> Coefficients:
    """A share ``size`` of the turns is bypassed: R and K fall in proportion, L with its square."""
    left = 1.0 - size
    return c._replace(
        resistance=c.resistance * left,
        force_constant=c.force_constant * left,
        current_decay=c.current_decay ** (1.0 / left),
    )


def _winding_open(c: Coefficients, size: float, _own: Numbers) -> Coefficients:
    """Contact lost: the resistance tends to infinity as ``size`` approaches 1."""
    left = max(1.0 - size, 1e-9)
    return c._replace(resistance=c.resistance / left, current_decay=c.current_decay ** (1.0 / left))


def _motor_failure(c: Coefficients, size: float, own: Numbers) -> Coefficients:
    """The motor draws no current and produces no torque: K and 1/R fall together."""
    opened = _winding_open(c, size, own)
    return opened._replace(force_constant=c.force_constant * max(1.0 - size, 0.0))


def _supply_open(c: Coefficients, size: float, _own: Numbers) -> Coefficients:
    """The bridge has no supply: its transistors stay off and the motor coasts."""
    if size >= 1.0:
        return c._replace(supply=0.0, bridge=0.0)
    return c._replace(supply=c.supply * (1.0 - size))


def _supply_short(c: Coefficients, size: float, _own: Numbers) -> Coefficients:
    """The supply rail is pulled down and the motor brakes itself through the bridge."""
    return c._replace(supply=c.supply * (1.0 - size))


def _magnet_loss(c: Coefficients, size: float, _own: Numbers) -> Coefficients:
    """The magnets lose a share ``size``: back-EMF and torque constant alone."""
    return c._replace(force_constant=c.force_constant * (1.0 - size))


def _winding_resistance_rise(c: Coefficients, size: float, _own: Numbers) -> Coefficients:
    """The winding's resistance grows by a share ``size``, and nothing else changes."""
    grown = 1.0 + size
    return c._replace(resistance=c.resistance * grown, current_decay=c.current_decay**grown)


def _supply_sag(c: Coefficients, size: float, _own: Numbers) -> Coefficients:
    """The supply sags by a share ``size``, and a bridge of given duty passes it on."""
    return c._replace(supply=c.supply * (1.0 - size), duty=c.duty * (1.0 - size))


def _weak_drive(c: Coefficients, size: float, _own: Numbers) -> Coefficients:
    """The bridge delivers a share ``size`` less than commanded."""
    return c._replace(duty=c.duty * (1.0 - size))


def _controller_gain(c: Coefficients, size: float, _own: Numbers) -> Coefficients:
    """The position controller answers to ``size`` times the error."""
    return c._replace(position_gain=c.position_gain * size, position_reset=c.position_reset * size)


def _slipping_gear(c: Coefficients, size: float, _own: Numbers) -> Coefficients:
    """The motor turns a share ``size`` farther than the nut goes, and its gear takes the power."""
    return c._replace(slip=size)


def _second_load(c: Coefficients, size: float, _own: Numbers) -> Coefficients:
    """A constant force on the nut that the load cell does not feel."""
    return c._replace(unseen_load=size)


def _unbalance(c: Coefficients, size: float, _own: Numbers) -> Coefficients:
    """A part has moved in its clamp: another moment where the link lies level."""
    return c._replace(link_moment=c.link_moment + size)


def _none(c: Coefficients, _size: float, _own: Numbers) -> Coefficients:
    return c


@dataclass(frozen=True)
class PlantFault:
    """What a fault of the hardware does; ``numbers`` are those that a machine states for it."""

    title: str
    size_unit: str
    approach: str
    effect: Callable[[Coefficients, float, Numbers], Coefficients]
    numbers: tuple[str, ...] = ()
    places: tuple[str, ...] = ("plant",)


PLANT_FAULTS: Mapping[str, PlantFault] = {
    "jam": PlantFault("ball screw jam (heavy drag)", "of a jammed unit", "physics", _jam,
                      ("coulomb_n", "viscous_n_s_m", "load_friction")),
    "spall": PlantFault("spall on the ball screw's raceway", "of a 1 mm pit", "hybrid", _spall,
                        ("ripple_n", "coulomb_n")),
    "ball_nut_friction": PlantFault(
        "ball nut friction (lubrication lost)", "times nominal viscous friction", "hybrid",
        _ball_nut_friction, ("dry_share",)),
    "gear_friction": PlantFault(
        "gear friction (lubrication lost)", "times nominal viscous friction", "hybrid",
        _ball_nut_friction, ("dry_share",)),
    "bearing_friction": PlantFault(
        "bearing friction (lubrication lost)", "times nominal viscous friction", "physics",
        _ball_nut_friction, ("dry_share",)),
    "backlash": PlantFault("backlash of the nut", "m", "hybrid", _backlash),
    "rotor_eccentricity": PlantFault("rotor shaft eccentricity", "of 0.1 mm", "hybrid",
                                     _rotor_eccentricity, ("ripple_n",)),
    "winding_short": PlantFault("winding short (turns bypassed)", "share of turns", "physics",
                                _winding_short),
    "winding_resistance_rise": PlantFault(
        "rise of the winding's resistance", "share of the resistance", "physics",
        _winding_resistance_rise),
    "magnet_loss": PlantFault("loss of magnet strength", "share of the motor constants",
                              "physics", _magnet_loss),
    "winding_open": PlantFault("stator coil fails open", "share of conductance lost", "physics",
                               _winding_open),
    "motor_failure": PlantFault("motor failure", "share of torque lost", "physics",
                                _motor_failure),
    "supply_open": PlantFault("power supply open circuit", "share of supply lost", "hybrid",
                              _supply_open),
    "supply_short": PlantFault("power supply short circuit", "share of supply lost", "hybrid",
                               _supply_short),
    "supply_sag": PlantFault("sagging supply", "share of supply lost", "physics", _supply_sag),
    "weak_drive": PlantFault("weak drive", "share of the output voltage lost", "physics",
                             _weak_drive),
    "controller_gain": PlantFault("gain of the position controller", "times its gain", "physics",
                                  _controller_gain),
    "slipping_gear": PlantFault("slipping gear", "share of the motor's way", "physics",
                                _slipping_gear),
    "unbalance": PlantFault("moment of what turns out of balance", "N m", "physics", _unbalance),
    "second_load": PlantFault("second load, not on the load cell", "N", "physics", _second_load),
    "accelerometer_1_fault": PlantFault(
        "accelerometer 1 (motor housing): noise, or dead at size 0", "m/s^2 of noise, 0: dead",
        "data", _none, places=("daq",)),
    "accelerometer_2_fault": PlantFault(
        "accelerometer 2 (nut): noise, or dead at size 0", "m/s^2 of noise, 0: dead",
        "data", _none, places=("daq",)),
}  # fmt: skip
"""Every fault of the hardware that can be simulated; a machine's file says which it can have."""

SIZES = ("size", "minimum", "maximum")
SIZE_UNIT = "size_unit"
"""Key by which a machine says what size 1 is, where it knows better."""
MODES = ("bias", "drift", "scaling", "dead", "noise", "dropout")
MODE_UNIT = {
    "bias": "{unit}", "drift": "{unit}/s", "scaling": "times true value", "dead": "{unit} shown",
    "noise": "{unit} of added noise", "dropout": "drop-outs per second",
}  # fmt: skip
MODE_APPROACH = {
    "bias": "physics", "drift": "data", "scaling": "physics", "dead": "physics",
    "noise": "data", "dropout": "physics",
}  # fmt: skip

LOOP_CHANNELS = {"actuator_position": True, "motor_current": False, "load_force": False}
"""Channels that a control loop reads, and whether its sensor faults act there by default."""


def _plant_fault(fault: str, own: Mapping[str, Any], where: str) -> FaultRow:
    """Row of a fault of the hardware with the numbers of a machine."""
    if fault not in PLANT_FAULTS:
        raise ConfigurationError(
            f"{where}: unknown fault {shown(fault)}, known are {', '.join(PLANT_FAULTS)}"
        )
    what = PLANT_FAULTS[fault]
    size_unit = own.get(SIZE_UNIT, what.size_unit)
    stated = {key: value for key, value in own.items() if key != SIZE_UNIT}
    numbers = numbers_of(stated, (*SIZES, *what.numbers), where)
    change = partial(_changed, what, numbers)
    return FaultRow(
        fault, what.title, what.places, *(numbers[key] for key in SIZES), str(size_unit),
        what.approach, change,
    )  # fmt: skip


def _changed(what: PlantFault, own: Numbers, c: Coefficients, size: float) -> Coefficients:
    return what.effect(c, size, own)


def _sensor_fault(channel: str, mode: str, unit: str, own: Numbers) -> FaultRow:
    limit = own["limit"]
    default = 0.0 if mode == "dead" else own[mode]
    low, high = {"scaling": (-10.0, 10.0), "noise": (0.0, limit), "dropout": (0.01, 20.0)}.get(
        mode, (-limit, limit)
    )
    places: tuple[str, ...] = ("daq",)
    if channel in LOOP_CHANNELS:
        places = (
            ("loop", "daq") if LOOP_CHANNELS[channel] and mode != "dropout" else ("daq", "loop")
        )
    return FaultRow(
        f"{channel}_{mode}", f"{channel.replace('_', ' ')}: {mode}", places, default, low, high,
        MODE_UNIT[mode].format(unit=unit), MODE_APPROACH[mode], None, channel, mode,
    )  # fmt: skip


SENSOR_NUMBERS = ("limit", *(mode for mode in MODES if mode != "dead"))
"""What a machine states for each channel: largest bias, and the default size of each mode."""


def sensor_channels(machine: Machine) -> tuple[str, ...]:
    """Channels of a machine that can have faults."""
    return tuple(machine.sensor_faults)


@lru_cache(maxsize=8)
def catalogue(machine: Machine) -> Mapping[str, FaultRow]:
    """Every fault that a machine can have.

    Raises
    ------
    ConfigurationError
        Its file names an unknown fault or channel, or lacks a number.
    """
    units = {row.channel: row.unit for row in machine.instruments}
    rows = [
        _plant_fault(fault, own, f"machine {machine.name}: faults: {fault}")
        for fault, own in machine.faults.items()
    ]
    for channel, own in machine.sensor_faults.items():
        where = f"machine {machine.name}: sensor_faults: {channel}"
        if channel not in units:
            raise ConfigurationError(f"{where}: no such channel, known are {', '.join(units)}")
        numbers = numbers_of(own, SENSOR_NUMBERS, where)
        rows += [_sensor_fault(channel, mode, units[channel], numbers) for mode in MODES]
    return MappingProxyType({row.id: row for row in rows})


def fault_named(fault: str, machine: Machine, where: str) -> FaultRow:
    """Row of one fault.

    Raises
    ------
    ConfigurationError
        The machine cannot have such a fault.
    """
    rows = catalogue(machine)
    if fault not in rows:
        raise ConfigurationError(
            f"{where}: unknown fault {shown(fault)}, known are "
            f"{', '.join(machine.faults)} and <channel>_<mode> with channel "
            f"{', '.join(machine.sensor_faults)} and mode {', '.join(MODES)}"
        )
    return rows[fault]
