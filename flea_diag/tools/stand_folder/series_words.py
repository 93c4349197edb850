"""What the name of a series says: its quantity, whose it is, and its unit."""

from __future__ import annotations

import re
from dataclasses import dataclass

from flea_diag.core.symbolic.converted_unit import CONVERTED
from flea_diag.core.symbolic.unit import dimension

POSITION, SPEED, CURRENT, VOLTAGE = "position", "speed", "current", "voltage"
FORCE, TORQUE, EFFORT, TEMPERATURE = "force", "torque", "effort", "temperature"
OTHER = "other"
QUANTITIES: dict[str, str] = {
    **dict.fromkeys(
        ("position", "pos", "displacement", "stroke", "extension", "angle", "lvdt", "encoder"),
        POSITION,
    ),
    **dict.fromkeys(("potentiometer", "pot", "travel", "theta", "elongation"), POSITION),
    **dict.fromkeys(("speed", "velocity", "vel", "omega", "rpm", "rate", "tacho"), SPEED),
    **dict.fromkeys(
        ("current", "curr", "amps", "ampere", "amp", "i", "iq", "imot", "amperage"), CURRENT
    ),
    **dict.fromkeys(("voltage", "volt", "volts", "u", "uq", "umot"), VOLTAGE),
    **dict.fromkeys(("force", "loadcell", "thrust", "tension", "fz", "fx", "fy"), FORCE),
    **dict.fromkeys(("torque", "moment", "tq", "tau"), TORQUE),
    "effort": EFFORT,
    **dict.fromkeys(
        ("temperature", "temp", "celsius", "kelvin", "fahrenheit", "thermo", "thermocouple"),
        TEMPERATURE,
    ),
    **dict.fromkeys(
        ("error", "err", "accel", "acceleration", "acc", "vibration", "pressure", "power"), OTHER
    ),
    **dict.fromkeys(
        (
            "energy",
            "percentage",
            "charge",
            "capacity",
            "humidity",
            "count",
            "counter",
            "index",
            "id",
        ),
        OTHER,
    ),
}
"""Word -> quantity; the last word of a name that has one decides, but for ``OTHER``."""
LETTERS = {"x": POSITION, "f": FORCE, "n": SPEED, "phi": POSITION}
"""Names of one letter that stand alone."""
COMMANDED, ERROR = "commanded", "error"
QUALIFIERS: dict[str, str] = {
    **dict.fromkeys(
        ("commanded", "command", "cmd", "setpoint", "target", "desired", "demand", "demanded"),
        COMMANDED,
    ),
    **dict.fromkeys(("reference", "ref", "sp", "set", "goal", "wanted"), COMMANDED),
    **dict.fromkeys(("error", "err", "deviation", "lag"), ERROR),
    **dict.fromkeys(("ambient", "air", "room", "environment", "env", "lab", "outside"), "ambient"),
    **dict.fromkeys(
        ("motor", "winding", "stator", "coil", "mot", "imot", "umot", "drive", "servo"), "motor"
    ),
    **dict.fromkeys(("nut", "screw", "ballscrew", "spindle"), "nut"),
    **dict.fromkeys(("load", "output", "brake", "external", "loadcell"), "load"),
    **dict.fromkeys(("actuator", "ram", "rod", "piston", "cylinder"), "actuator"),
    **dict.fromkeys(
        ("surface", "aileron", "flap", "rudder", "elevator", "hinge", "crank"), "surface"
    ),
    **dict.fromkeys(("supply", "bus", "battery", "psu", "dc", "mains"), "supply"),
}
"""Word -> what it says of a channel."""

UNITS: dict[str, str] = {
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

TYPED: dict[tuple[str, str], str] = {
    ("JointState", "velocity"): "rad/s",
    ("JointState", "position"): "rad",
    ("JointState", "effort"): "N*m",
    ("Temperature", "temperature"): "degC",
    ("BatteryState", "voltage"): "V",
    ("BatteryState", "current"): "A",
    ("BatteryState", "cell_voltage"): "V",
    ("BatteryState", "temperature"): "degC",
    ("WrenchStamped", "force"): "N",
    ("WrenchStamped", "torque"): "N*m",
    ("Wrench", "force"): "N",
    ("Wrench", "torque"): "N*m",
}
"""Message type and field -> unit by the definition of the message, which not every sender keeps."""


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


def words_of(name: str, message: str = "") -> NameWords:
    """What a name says: that of a column, or topic and field of a message."""
    parts = [name] if not message else [p for p in _STEPS.split(name) if p not in _CARRIERS]
    words = [word.lower() for part in parts for word in _WORD.findall(part)]
    said = [QUANTITIES[word] for word in words if word in QUANTITIES]
    quantity = OTHER if OTHER in said else (said[-1] if said else "")
    if not said and {"setpoint", "point", "at"} & set(words):
        quantity = POSITION
    if not said and "ambient" in (QUALIFIERS.get(word) for word in words):
        quantity = TEMPERATURE
    if not said and len(words) == 1:
        quantity = LETTERS.get(words[0], "")
    unit = next((u for part in reversed(parts) if (u := _unit(part, quantity))), "")
    if not quantity and unit:
        quantity = quantity_of(unit)
    if not quantity and "load" in words:
        quantity = FORCE
    if quantity == FORCE and unit and quantity_of(unit) == TORQUE:
        quantity = TORQUE
    kind = message.rpartition("/")[2]
    typed = next((u for (k, f), u in TYPED.items() if k == kind and f in parts), "")
    if typed and not quantity:
        quantity = quantity_of(typed)
    if typed and quantity not in (EFFORT, quantity_of(typed)):
        typed = ""
    qualifiers = frozenset(QUALIFIERS[word] for word in words if word in QUALIFIERS)
    return NameWords(quantity, qualifiers, unit, typed)


def _unit(part: str, quantity: str) -> str:
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
