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

"""What each fault of the hardware does to the coefficients of the plant.

A new fault is a row of ``PLANT_FAULTS`` and a small function from coefficients and size to
coefficients.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from flea_sim_driver.plant.coefficients import Coefficients
from flea_sim_driver.plant.plant import STEP_S

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


def _supply_noise(c: Coefficients, size: float, own: Numbers) -> Coefficients:
    """Ripple of the supply, a share ``size`` of it, which a bridge of given duty passes on."""
    return c._replace(link_turns=own["ripple_hz"] * STEP_S, link_ripple=size)


def _capacitor_loss(c: Coefficients, size: float, own: Numbers) -> Coefficients:
    """A share ``size`` of the link's capacitance is lost: it is drained from peak to peak.

    Between two peaks of the rectifier a current I takes I / (f C) volts from it.
    """
    left = max(1.0 - size, 1e-3)
    healthy = 1.0 / (own["ripple_hz"] * own["capacitance_f"])
    return c._replace(link_turns=own["ripple_hz"] * STEP_S, link_ohm=healthy * (1.0 / left - 1.0))


LEAKAGE_DOUBLES_K = 10.0
"""Of an electrolytic capacitor, the usual rule."""


def _capacitor_runaway(c: Coefficients, size: float, own: Numbers) -> Coefficients:
    """The link's capacitor has heated a share ``size`` of the way to its breakdown, a short at 1.

    Its leakage warms it, and doubles every 10 K: a warming that is linear in time draws a current
    that is exponential in it.
    """
    if size >= 1.0:
        return c._replace(supply=0.0)
    leak_a = own["leak_a"] * 2.0 ** (-own["rise_k"] * (1.0 - size) / LEAKAGE_DOUBLES_K)
    return c._replace(supply=c.supply - c.supply_resistance * leak_a)


def _transistor_breakdown(c: Coefficients, size: float, _own: Numbers) -> Coefficients:
    """The gate of one transistor leaks: its leg conducts worse, and not at all at size 1.

    A share ``size`` of the conductance of leg and winding is lost, one way alone.
    """
    left = max(1.0 - size, 1e-9)
    leg = c.resistance * (1.0 / left - 1.0)
    return c._replace(leg_resistance=leg, leg_decay=c.current_decay ** (1.0 / left))


def _lead_leak(c: Coefficients, size: float, _own: Numbers) -> Coefficients:
    """Chafed leads of the motor: a conductance from one to the other, beyond the current sensor."""
    return c._replace(leak=size)


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
    "supply_noise": PlantFault("ripple of the supply", "share of its voltage", "data",
                               _supply_noise, ("ripple_hz",)),
    "capacitor_loss": PlantFault("loss of the link's capacitance", "share of it lost", "data",
                                 _capacitor_loss, ("ripple_hz", "capacitance_f")),
    "capacitor_runaway": PlantFault(
        "thermal runaway of the link's capacitor", "share of the way to its breakdown", "hybrid",
        _capacitor_runaway, ("leak_a", "rise_k")),
    "transistor_breakdown": PlantFault(
        "gate of one transistor broken down", "share of its leg's conductance lost", "hybrid",
        _transistor_breakdown),
    "lead_leak": PlantFault("insulation of the motor's leads chafed", "S", "data", _lead_leak),
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
