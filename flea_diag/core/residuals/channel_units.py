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

"""Standard channels of a scan and their units; a stand uses those that it has."""

from __future__ import annotations

from collections.abc import Mapping

from flea_diag.errors import shown

CURRENT, VOLTAGE, COMMAND = "motor_current", "motor_voltage", "commanded_voltage"
ENCODER, POSITION, LOAD = "motor_speed", "actuator_position", "load_force"

UNITS: Mapping[str, str] = {
    CURRENT: "A",
    VOLTAGE: "V",
    COMMAND: "V",
    ENCODER: "rad/s",
    POSITION: "m",
    "load_position": "m",
    LOAD: "N",
    "motor_temperature": "degC",
    "nut_temperature": "degC",
    "ambient_temperature": "degC",
}
"""Unit of each standard channel, where a description states no other; in the order of rows."""
ACCELEROMETER, ACCELERATION = "accelerometer_", "m/s^2"
"""First part of the name of each axis of vibration, and its unit."""
SPELLINGS = {
    "A": ("ampere", "amperes"),
    "V": ("volt", "volts"),
    "rad/s": ("rad*s^-1", "rad s^-1"),
    "m": ("meter", "meters", "metre", "metres"),
    "N": ("newton", "newtons"),
    "degC": ("C", "°C", "℃", "celsius", "Celsius"),
    "m/s^2": ("m/s²", "m/s2", "m/s**2", "m*s^-2"),
}
"""Other spellings of the same unit."""


def unit_refusal(channel: str, unit: str, units: Mapping[str, str] = UNITS) -> str:
    """Why a channel in this unit cannot be used; empty where it can, or its unit is unknown.

    ``units`` are those of a description. Values are not converted: a factor that is right for one
    channel hides a wrong one of another.
    """
    needed = ACCELERATION if channel.startswith(ACCELEROMETER) else units.get(channel, "")
    if not needed or unit in ("", needed, *SPELLINGS.get(needed, ())):
        return ""
    return f"{channel} is in {shown(unit)}, must be in {needed!r}: convert it at the source"
