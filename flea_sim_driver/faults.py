"""Fault catalogue of the simulated stand: effect, place and size of each fault.

A new fault is a row of ``PLANT_FAULTS`` and a small function from coefficients and size to
coefficients. Sensor faults of every channel and mode follow from ``SENSOR_SIZES``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from flea_diag.errors import ConfigurationError, shown
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


def _jam(c: Coefficients, size: float) -> Coefficients:
    """Drag as on the jammed FLEA unit at size 1: +58 N dry, +2500 N s/m, more under load."""
    return c._replace(
        coulomb=c.coulomb + 58.0 * size,
        viscous=c.viscous + 2500.0 * size,
        load_friction=c.load_friction + 0.05 * size,
    )


def _ball_nut_friction(c: Coefficients, size: float) -> Coefficients:
    """Failed lubrication: viscous drag grows by ``size`` times its nominal value."""
    return c._replace(viscous=c.viscous * (1.0 + size), coulomb=c.coulomb * (1.0 + 0.05 * size))


def _spall(c: Coefficients, size: float) -> Coefficients:
    """Balls passing a pit: a zero-mean force ripple at ball pass and hardly any drag."""
    return c._replace(spall=6.0 * size, coulomb=c.coulomb + 2.0 * size)


def _backlash(c: Coefficients, size: float) -> Coefficients:
    return c._replace(backlash=c.backlash + size)


def _rotor_eccentricity(c: Coefficients, size: float) -> Coefficients:
    return c._replace(eccentric=c.eccentric + 8.0 * size)


def _winding_short(c: Coefficients, size: float) -> Coefficients:
    """A share ``size`` of the turns is bypassed: R and K fall in proportion, L with its square."""
    left = 1.0 - size
    return c._replace(
        resistance=c.resistance * left,
        force_constant=c.force_constant * left,
        current_decay=c.current_decay ** (1.0 / left),
    )


def _winding_open(c: Coefficients, size: float) -> Coefficients:
    """Contact lost: the resistance tends to infinity as ``size`` approaches 1."""
    left = max(1.0 - size, 1e-9)
    return c._replace(resistance=c.resistance / left, current_decay=c.current_decay ** (1.0 / left))


def _motor_failure(c: Coefficients, size: float) -> Coefficients:
    """The motor draws no current and produces no torque: K and 1/R fall together."""
    return _winding_open(c, size)._replace(force_constant=c.force_constant * max(1.0 - size, 0.0))


def _supply_open(c: Coefficients, size: float) -> Coefficients:
    """The bridge has no supply: its transistors stay off and the motor coasts."""
    if size >= 1.0:
        return c._replace(supply=0.0, bridge=0.0)
    return c._replace(supply=c.supply * (1.0 - size))


def _supply_short(c: Coefficients, size: float) -> Coefficients:
    """The supply rail is pulled down and the motor brakes itself through the bridge."""
    return c._replace(supply=c.supply * (1.0 - size))


def _none(c: Coefficients, _size: float) -> Coefficients:
    return c


PLANT_FAULTS: tuple[FaultRow, ...] = (
    FaultRow("jam", "ball screw jam (heavy drag)", ("plant",),
          1.0, 0.01, 20.0, "of the FLEA's jammed unit", "physics", _jam),
    FaultRow("spall", "spall on the ball screw's raceway", ("plant",),
          1.0, 0.05, 5.0, "of a 1 mm pit", "hybrid", _spall),
    FaultRow("ball_nut_friction", "ball nut friction (lubrication lost)", ("plant",),
          3.0, 0.1, 20.0, "times nominal viscous friction", "hybrid", _ball_nut_friction),
    FaultRow("backlash", "backlash of the nut", ("plant",),
          3e-4, 1e-5, 3e-3, "m", "hybrid", _backlash),
    FaultRow("rotor_eccentricity", "rotor shaft eccentricity", ("plant",),
          1.0, 0.05, 10.0, "of 0.1 mm", "hybrid", _rotor_eccentricity),
    FaultRow("winding_short", "winding short (turns bypassed)", ("plant",),
          0.2, 0.01, 0.9, "share of turns", "physics", _winding_short),
    FaultRow("winding_open", "stator coil fails open", ("plant",),
          1.0, 0.05, 1.0, "share of conductance lost", "physics", _winding_open),
    FaultRow("motor_failure", "motor failure", ("plant",),
          1.0, 0.1, 1.0, "share of torque lost", "physics", _motor_failure),
    FaultRow("supply_open", "power supply open circuit", ("plant",),
          1.0, 0.1, 1.0, "share of supply lost", "hybrid", _supply_open),
    FaultRow("supply_short", "power supply short circuit", ("plant",),
          1.0, 0.1, 1.0, "share of supply lost", "hybrid", _supply_short),
    FaultRow("accelerometer_1_fault", "accelerometer 1 (motor housing): noise, or dead at size 0",
          ("daq",), 8.0, 0.0, 500.0, "m/s^2 of noise, 0: dead", "data", _none),
    FaultRow("accelerometer_2_fault", "accelerometer 2 (nut): noise, or dead at size 0",
          ("daq",), 12.0, 0.0, 500.0, "m/s^2 of noise, 0: dead", "data", _none),
)  # fmt: skip

MODES = ("bias", "drift", "scaling", "dead", "noise", "dropout")
MODE_UNIT = {
    "bias": "{unit}", "drift": "{unit}/s", "scaling": "times true value", "dead": "{unit} shown",
    "noise": "{unit} of added noise", "dropout": "drop-outs per second",
}  # fmt: skip
MODE_APPROACH = {
    "bias": "physics", "drift": "data", "scaling": "physics", "dead": "physics",
    "noise": "data", "dropout": "physics",
}  # fmt: skip

SENSOR_SIZES: dict[str, tuple[str, float, float, float, float, float, float]] = {
    # channel: unit, limit of a bias, then default bias, drift, scaling, noise, drop-outs
    "motor_current": ("A", 20.0, 0.8, 0.1, 1.4, 0.6, 1.0),
    "motor_voltage": ("V", 50.0, 4.0, 0.5, 1.3, 3.0, 1.0),
    "motor_speed": ("rad/s", 500.0, 12.0, 1.5, 1.3, 10.0, 1.0),
    "actuator_position": ("m", 0.1, 4e-3, 5e-4, 1.15, 1e-3, 1.0),
    "load_position": ("m", 0.1, 4e-3, 5e-4, 1.15, 1e-3, 1.0),
    "load_force": ("N", 2000.0, 90.0, 12.0, 1.5, 60.0, 1.0),
    "motor_temperature": ("degC", 500.0, 8.0, 0.8, 1.4, 5.0, 1.0),
    "nut_temperature": ("degC", 500.0, 10.0, 1.0, 1.4, 8.0, 1.0),
    "ambient_temperature": ("degC", 100.0, 3.0, 0.2, 1.2, 1.0, 1.0),
    "load_motor_current": ("A", 20.0, 0.8, 0.1, 1.4, 0.6, 1.0),
}
SENSOR_CHANNELS = tuple(SENSOR_SIZES)
LOOP_CHANNELS = {"actuator_position": True, "motor_current": False, "load_force": False}
"""Channels that a control loop reads, and whether its sensor faults act there by default."""


def _sensor_fault(channel: str, mode: str) -> FaultRow:
    unit, limit, bias, drift, scaling, noise, dropout = SENSOR_SIZES[channel]
    default = {"bias": bias, "drift": drift, "scaling": scaling, "dead": 0.0,
               "noise": noise, "dropout": dropout}[mode]  # fmt: skip
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


SENSOR_FAULTS = tuple(_sensor_fault(channel, mode) for channel in SENSOR_CHANNELS for mode in MODES)
CATALOGUE: dict[str, FaultRow] = {row.id: row for row in PLANT_FAULTS + SENSOR_FAULTS}


def fault_named(fault: str, where: str) -> FaultRow:
    """Row of one fault.

    Raises
    ------
    ConfigurationError
        The catalogue has no such fault.
    """
    if fault not in CATALOGUE:
        raise ConfigurationError(
            f"{where}: unknown fault {shown(fault)}, known are "
            f"{', '.join(row.id for row in PLANT_FAULTS)} and <channel>_<mode> with channel "
            f"{', '.join(SENSOR_CHANNELS)} and mode {', '.join(MODES)}"
        )
    return CATALOGUE[fault]
