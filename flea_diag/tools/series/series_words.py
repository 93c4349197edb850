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

"""What the name of a series says: its quantity, whose it is, and its unit."""

from __future__ import annotations

import re
from dataclasses import dataclass
from itertools import pairwise

from flea_diag.core.symbolic.converted_unit import CONVERTED
from flea_diag.core.symbolic.unit import dimension

POSITION, SPEED, CURRENT, VOLTAGE = "position", "speed", "current", "voltage"
FORCE, TORQUE, EFFORT, TEMPERATURE = "force", "torque", "effort", "temperature"
OTHER = "other"
QUANTITIES: dict[str, str] = {
    **dict.fromkeys(
        ("position", "pos", "displacement", "stroke", "extension", "angle", "lvdt", "encoder",
         "potentiometer", "pot", "travel", "theta", "elongation", "positions", "angles", "q",
         "lage", "weg", "winkel", "hub", "posn"),
        POSITION,
    ),
    **dict.fromkeys(
        ("speed", "velocity", "vel", "omega", "rpm", "rate", "tacho", "velocities", "speeds", "qd",
         "dq", "qdot", "geschwindigkeit", "drehzahl", "vitesse"),
        SPEED,
    ),
    **dict.fromkeys(
        ("current", "curr", "amps", "ampere", "amp", "i", "iq", "imot", "amperage", "currents",
         "strom", "cur", "courant"),
        CURRENT,
    ),
    **dict.fromkeys(
        ("voltage", "volt", "volts", "u", "uq", "umot", "voltages", "spannung"), VOLTAGE
    ),
    **dict.fromkeys(
        ("force", "loadcell", "thrust", "tension", "fz", "fx", "fy", "forces", "kraft"), FORCE
    ),
    **dict.fromkeys(
        ("torque", "moment", "tq", "tau", "torques", "moments", "drehmoment", "trq"), TORQUE
    ),
    **dict.fromkeys(("effort", "efforts"), EFFORT),
    **dict.fromkeys(
        ("temperature", "temp", "celsius", "kelvin", "fahrenheit", "thermo", "thermocouple",
         "temperatures", "temps", "temperatur"),
        TEMPERATURE,
    ),
    **dict.fromkeys(
        ("error", "err", "accel", "acceleration", "acc", "vibration", "pressure", "power",
         "energy", "percentage", "charge", "capacity", "humidity", "count", "counter", "index",
         "id", "accelerations", "qdd", "ddq", "tcp", "pose", "cartesian", "imu", "gyro",
         "orientation", "quaternion", "quat", "qw", "qx", "qy", "qz", "timestep", "timestamp",
         "duty", "pwm", "odom", "battery", "cartesian", "jerk", "gps", "feedrate", "accuracy",
         "variance", "covariance", "innov", "innovation", "innovations", "cpuload", "cpu"),
        OTHER,
    ),
}  # fmt: skip
"""Word -> quantity; the last word of a name that has one decides, but for ``OTHER``."""
WEAK = frozenset({
    "mode", "status", "line", "number", "seq", "step", "frame", "flag", "flags", "code", "program",
    "block", "bits", "mask", "uptime", "nr", "sequence", "row", "time", "stamp", "tick", "cycle",
    "state", "scaling",
})  # fmt: skip
"""Words of columns that no sensor fills, where no other word says a quantity."""
COMPOUNDS = ("strom", "drehzahl", "lage",
             "spannung", "winkel", "temperatur", "kraft", "geschwindigkeit",
             "position", "drehmoment", "weg")  # fmt: skip
"""Words that others end on, in German."""
LETTERS = {"x": POSITION, "f": FORCE, "n": SPEED, "phi": POSITION}
"""Names of one letter that stand alone."""
COMMANDED, ERROR = "commanded", "error"
QUALIFIERS: dict[str, str] = {
    **dict.fromkeys(
        ("commanded", "command", "cmd", "setpoint", "target", "desired", "demand", "demanded"),
        COMMANDED,
    ),
    **dict.fromkeys(("reference", "ref", "sp", "set", "goal", "wanted", "soll"), COMMANDED),
    **dict.fromkeys(("error", "err", "deviation", "lag"), ERROR),
    **dict.fromkeys(("ambient", "air", "room", "environment", "env", "lab", "outside"), "ambient"),
    **dict.fromkeys(
        ("motor", "winding", "stator", "coil", "mot", "imot", "umot", "drive", "servo"), "motor"
    ),
    **dict.fromkeys(("nut", "screw", "ballscrew", "spindle"), "nut"),
    **dict.fromkeys(("load", "output", "brake", "external", "ext", "loadcell"), "load"),
    **dict.fromkeys(("actuator", "ram", "rod", "piston", "cylinder"), "actuator"),
    **dict.fromkeys(
        ("surface", "aileron", "flap", "rudder", "elevator", "hinge", "crank"), "surface"
    ),
    **dict.fromkeys(("supply", "bus", "battery", "psu", "dc", "mains", "robot"), "supply"),
}
"""Word -> what it says of a channel."""

UNITS: dict[str, str] = {
    **dict.fromkeys(("r/min", "1/min", "u/min", "min-1", "1_min", "min^-1"), "rpm"),
    **dict.fromkeys(("grad", "degs"), "deg"),
    **dict.fromkeys(("°/s", "grad/s"), "deg/s"),
    **dict.fromkeys(("um", "mm", "cm", "in", "ft", "rad", "mrad", "deg", "rev", "rpm"), ""),
    **dict.fromkeys(("mA", "mV", "kV", "V", "A", "N", "kN", "lbf", "kgf", "m"), ""),
    **dict.fromkeys(("mm/s", "in/s", "m/s", "rad/s", "deg/s", "rev/s", "degC", "degF", "K"), ""),
    **dict.fromkeys(("inch", "inches"), "in"),
    **dict.fromkeys(("degree", "degrees", "°"), "deg"),
    **dict.fromkeys(("amp", "amps", "ampere"), "A"),
    **dict.fromkeys(("volt", "volts"), "V"),
    **dict.fromkeys(("newton", "newtons"), "N"),
    **dict.fromkeys(("lb", "lbs", "pounds"), "lbf"),
    "kg": "kgf",
    **dict.fromkeys(("nm", "n_m", "n.m", "n*m"), "N*m"),
    **dict.fromkeys(("mnm", "mn_m"), "mN*m"),
    **dict.fromkeys(("c", "celsius", "°c", "deg_c"), "degC"),
    **dict.fromkeys(("f", "fahrenheit", "°f", "deg_f"), "degF"),
    "kelvin": "K",
    **dict.fromkeys(("mm_s", "mmps"), "mm/s"),
    **dict.fromkeys(("m_s", "mps"), "m/s"),
    **dict.fromkeys(("rad_s", "radps", "rads"), "rad/s"),
    **dict.fromkeys(("deg_s", "degps", "dps"), "deg/s"),
    **dict.fromkeys(("rps", "rev_s"), "rev/s"),
}
"""Ending of a name -> unit; "": the ending is the unit itself."""
_ENDINGS = {word.lower(): unit or word for word, unit in UNITS.items()}
_ENDING = re.compile(
    r"(?:^|[\s_.\-\[(/])("
    + "|".join(map(re.escape, sorted(_ENDINGS, key=len, reverse=True)))
    + r")[\])]*$"
)
_WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+")
_STEPS = re.compile(r"[/.\[\]]+")
_CARRIERS = ("data", "value", "values", "status", "state", "states")
"""Fields that say nothing of what they carry."""
_BY_SI = {
    "m": POSITION, "rad": POSITION, "m/s": SPEED, "rad/s": SPEED, "A": CURRENT, "V": VOLTAGE,
    "N": FORCE, "N*m": TORQUE, "degC": TEMPERATURE,
}  # fmt: skip

_JOINT = {"position": "rad", "velocity": "rad/s", "effort": "N*m"}
_TYPES: dict[str, dict[str, str]] = {
    "JointState": _JOINT,
    "DynamicJointState": {**_JOINT, "temperature": "degC", "voltage": "V", "current": "A"},
    "JointTrajectoryControllerState": {
        "positions": "rad", "velocities": "rad/s", "effort": "N*m",
    },
    "JointControllerState": {"process_value": "", "set_point": ""},
    "Temperature": {"temperature": "degC"},
    "BatteryState": {
        "voltage": "V", "current": "A", "cell_voltage": "V", "temperature": "degC",
    },
    "WrenchStamped": {"force": "N", "torque": "N*m"},
    "Wrench": {"force": "N", "torque": "N*m"},
}  # fmt: skip
TYPED: dict[tuple[str, str], str] = {
    (kind, field): unit for kind, fields in _TYPES.items() for field, unit in fields.items()
}
"""Message type and field -> unit by the definition of the message, which not every sender keeps."""
_AXES = {("i", "q"), ("u", "q")}
"""Letters of the torque axis of a motor that a mark parts."""
_CONTROLLER = "JointTrajectoryControllerState"


@dataclass(frozen=True)
class NameWords:
    """What a name says.

    Parameters
    ----------
    quantity
        One of ``QUANTITIES``' values; "" if the name does not say.
    qualifiers
        Values of ``QUALIFIERS`` that occur in it.
    unit
        Unit that it ends on; "" for none.
    typed
        Unit by the message type; "" where that says none.
    """

    quantity: str
    qualifiers: frozenset[str]
    unit: str = ""
    typed: str = ""


def quantity_of(unit: str) -> str:
    """Quantity that an SI unit, or one that converts to it, is of."""
    si = CONVERTED[unit][0] if unit in CONVERTED else unit
    for known, quantity in _BY_SI.items():
        if known == si or (dimension(known) == dimension(si) and known != "rad"):
            return quantity
    return OTHER


def words_of(name: str, message: str = "", written: str = "") -> NameWords:
    """What a name says: that of a column, or topic and field of a message.

    ``written``: its unit in a row of units; "" for none.
    """
    parts = [name] if not message else [p for p in _STEPS.split(name) if p not in _CARRIERS]
    words = [word.lower() for part in parts for word in _WORD.findall(part)]
    quantity = _quantity_in(words)
    unit = unit_of(f"[{written}]", quantity) if written else ""
    unit = unit or next((u for part in reversed(parts) if (u := unit_of(part, quantity))), "")
    if not quantity and unit:
        quantity = quantity_of(unit)
    if not quantity and "load" in words:
        quantity = FORCE
    if quantity == FORCE and unit and quantity_of(unit) == TORQUE:
        quantity = TORQUE
    if not quantity and WEAK & set(words):
        quantity = OTHER
    kind = message.rpartition("/")[2]
    typed = next((u for (k, f), u in TYPED.items() if k == kind and f in parts), "")
    if typed and not quantity:
        quantity = quantity_of(typed)
    if typed and quantity not in (EFFORT, quantity_of(typed)):
        typed = ""
    qualifiers = frozenset(QUALIFIERS[word] for word in words if word in QUALIFIERS)
    if kind == _CONTROLLER and "output" in words:
        qualifiers = (qualifiers - {"load"}) | {COMMANDED}
    return NameWords(quantity, qualifiers, unit, typed)


def _quantity_in(words: list[str]) -> str:
    """Quantity that the words of a name say."""
    joined = ["".join(pair) for pair in pairwise(words) if pair in _AXES]
    said = [q for word in words if (q := QUANTITIES.get(word) or _compound(word))]
    if joined:
        return QUANTITIES[joined[0]]
    if said:
        return OTHER if OTHER in said else said[-1]
    if {"setpoint", "point", "at"} & set(words):
        return POSITION
    if "ambient" in (QUALIFIERS.get(word) for word in words):
        return TEMPERATURE
    return LETTERS.get(words[0], "") if len(words) == 1 else ""


def is_quantity(word: str) -> bool:
    """Whether a word of more than a letter says a quantity."""
    return word in QUANTITIES or bool(_compound(word))


def _compound(word: str) -> str:
    return next((QUANTITIES[end] for end in COMPOUNDS if word.endswith(end)), "")


def unit_of(part: str, quantity: str) -> str:
    """Unit that a name ends on, if it is one of its quantity."""
    found = _ENDING.search(part.strip().lower())
    ending = found[1] if found else (_WORD.findall(part) or [""])[-1].lower()
    if ending not in _ENDINGS:
        return ""
    unit = _ENDINGS[ending]
    own = quantity_of(unit)
    if quantity in ("", EFFORT):
        return "" if ending == part.strip().lower() and len(ending) < 2 else unit
    fits = own == quantity or {own, quantity} == {FORCE, TORQUE} or quantity == OTHER
    return unit if fits else ""
