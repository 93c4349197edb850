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

"""Units that people write, and the SI unit that each is converted to.

The description knows SI alone (``unit``); what comes from outside may be in any of these.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from flea_diag.core.symbolic.unit import UNITS, dimension, spelled
from flea_diag.errors import ConfigurationError, shown

POUND_FORCE_N, KILOGRAM_FORCE_N = 4.4482216152605, 9.80665  # by definition
INCH_M, FOOT_M = 0.0254, 0.3048  # by definition
_TURN, _DEGREE = 2.0 * math.pi, math.pi / 180.0

CONVERTED: dict[str, tuple[str, float, float]] = {
    "um": ("m", 1e-6, 0.0),
    "mm": ("m", 1e-3, 0.0),
    "cm": ("m", 1e-2, 0.0),
    "in": ("m", INCH_M, 0.0),
    "ft": ("m", FOOT_M, 0.0),
    "mm/s": ("m/s", 1e-3, 0.0),
    "in/s": ("m/s", INCH_M, 0.0),
    "mrad": ("rad", 1e-3, 0.0),
    "deg": ("rad", _DEGREE, 0.0),
    "rev": ("rad", _TURN, 0.0),
    "deg/s": ("rad/s", _DEGREE, 0.0),
    "rpm": ("rad/s", _TURN / 60.0, 0.0),
    "rev/s": ("rad/s", _TURN, 0.0),
    "mA": ("A", 1e-3, 0.0),
    "mV": ("V", 1e-3, 0.0),
    "kV": ("V", 1e3, 0.0),
    "kW": ("W", 1e3, 0.0),
    "kN": ("N", 1e3, 0.0),
    "lbf": ("N", POUND_FORCE_N, 0.0),
    "kgf": ("N", KILOGRAM_FORCE_N, 0.0),
    "mN*m": ("N*m", 1e-3, 0.0),
    "kgf*cm": ("N*m", KILOGRAM_FORCE_N * 1e-2, 0.0),
    "lbf*in": ("N*m", POUND_FORCE_N * INCH_M, 0.0),
    "lbf*ft": ("N*m", POUND_FORCE_N * FOOT_M, 0.0),
    "g": ("m/s^2", 9.80665, 0.0),
    "mm/s^2": ("m/s^2", 1e-3, 0.0),
    "K": ("degC", 1.0, -273.15),
    "degF": ("degC", 5.0 / 9.0, -160.0 / 9.0),
    "ms": ("s", 1e-3, 0.0),
    "us": ("s", 1e-6, 0.0),
    "ns": ("s", 1e-9, 0.0),
    "min": ("s", 60.0, 0.0),
    "h": ("s", 3600.0, 0.0),
    "d": ("s", 86400.0, 0.0),
}
"""Unit -> SI unit, and factor and offset that lead to it. A temperature in K is one in degC, not a
difference of two."""


@dataclass(frozen=True, slots=True)
class Conversion:
    """A value in ``unit`` (SI) is ``factor`` times the value as written, plus ``offset``."""

    unit: str
    factor: float
    offset: float

    def __call__(self, value: float) -> float:
        """The value in ``unit``."""
        return self.factor * value + self.offset


def conversion(unit: str, where: str) -> Conversion:
    """How to convert a unit to SI.

    Raises
    ------
    ConfigurationError
        The unit is unknown.
    """
    if unit in CONVERTED:
        return Conversion(*CONVERTED[unit])
    try:
        dimension(unit)
    except ConfigurationError:
        known = ", ".join(CONVERTED)
        raise ConfigurationError(
            f"{where}: unit {shown(unit)} is unknown; use SI ({', '.join(UNITS)} and * / ^) or one "
            f"of {known}"
        ) from None
    return Conversion(unit, 1.0, 0.0)


def conversion_to(unit: str, wanted: str, where: str) -> Conversion:
    """How to convert a unit to an SI unit of the same dimension.

    Raises
    ------
    ConfigurationError
        The unit is unknown or of another dimension.
    """
    found = conversion(unit, where)
    if dimension(found.unit) != dimension(wanted):
        fit = [name for name, (si, *_) in CONVERTED.items() if dimension(si) == dimension(wanted)]
        raise ConfigurationError(
            f"{where}: unit {shown(unit)} cannot be converted to {wanted}; use "
            f"{' or '.join([wanted or spelled(dimension(wanted)), *fit])}"
        )
    return Conversion(wanted, found.factor, found.offset)
