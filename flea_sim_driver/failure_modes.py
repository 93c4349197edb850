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

"""The common failure modes of electro-mechanical actuators and how this stand shows them.

Modes and approaches are those of Narasimhan et al. 2010, Table 1. For a mode that cannot affect
any signal of this stand, the reason is given.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class FailureMode:
    """One row: ``faults`` are ids of the catalogue, or empty with a ``reason``."""

    component: str
    mode: str
    approach: str
    faults: tuple[str, ...]
    how: str = ""
    reason: str = ""


NO_RESOLVER = "the stand has an encoder and a potentiometer, no resolver"
INSIDE_CONTROLLER = (
    "acts inside the motor controller, of which the stand measures the output voltage alone"
)

FAILURE_MODES: tuple[FailureMode, ...] = (
    FailureMode("Actuator", "Jam", "physics", ("jam",), "hardware: the jammed unit is switched in"),
    FailureMode("Actuator", "Spall", "hybrid", ("spall",), "hardware: the spalled unit"),
    FailureMode("Motor", "Winding short", "physics", ("winding_short",), "programmable rheostat"),
    FailureMode("Connectors", "Degraded operation", "data", ("winding_resistance_rise",),
                "contact resistance in the motor lead, in series with the winding"),
    FailureMode("Connectors", "Intermittent contact", "data", ("winding_open",),
                "with on_s and off_s"),
    FailureMode("Stator", "Stator coil fails open", "physics", ("winding_open",), "size 1"),
    FailureMode("Stator", "Insulation deterioration / wire chafing", "data", ("winding_short",),
                "with growth_s: turns bypassed one after another"),
    FailureMode("Resolver", "Coil fails open", "physics", ("actuator_position_dead",),
                "as a dead position sensor; " + NO_RESOLVER),
    FailureMode("Resolver", "Intermittent coil failures", "data", ("actuator_position_dropout",),
                "as drop-outs of the position sensor; " + NO_RESOLVER),
    FailureMode("Sensor", "Insulation deterioration / wire chafing", "data",
                ("motor_current_noise", "load_position_noise"), "noise with growth_s"),
    FailureMode("Sensor", "Bias", "physics", ("motor_current_bias", "motor_temperature_bias"),
                "software: every channel has this mode"),
    FailureMode("Sensor", "Scaling", "physics",
                ("motor_current_scaling", "motor_temperature_scaling"), "software"),
    FailureMode("Sensor", "Drift", "data", ("motor_current_drift", "motor_temperature_drift"),
                "software"),
    FailureMode("Power supply", "Noise", "data", (),
                reason="the 100 Hz channels average it away and the supply is not measured"),
    FailureMode("Power supply", "Intermittent dropout", "physics", ("supply_open",),
                "with on_s and off_s"),
    FailureMode("Power supply", "Short circuit", "hybrid", ("supply_short",), "size 1"),
    FailureMode("Power supply", "Open circuit", "hybrid", ("supply_open",), "size 1"),
    FailureMode("Controller capacitors", "Intermittent performance", "data", ("supply_open",),
                "size below 1 with on_s and off_s: the link voltage sags"),
    FailureMode("Controller capacitors", "Thermal runaway", "hybrid", (),
                reason="no temperature of the controller is measured"),
    FailureMode("Controller capacitors", "Dielectric breakdown", "hybrid", ("supply_short",),
                "a shorted link capacitor pulls the rail down"),
    FailureMode("Controller transistors", "Dielectric breakdown", "hybrid", (),
                reason="gate leakage " + INSIDE_CONTROLLER),
    FailureMode("Controller transistors", "Short circuit", "hybrid", ("supply_short",),
                "a shorted half bridge shorts the rail"),
    FailureMode("Wiring", "Open circuit", "hybrid", ("winding_open",), "size 1"),
    FailureMode("Wiring", "Insulation deterioration / wire chafing", "data", ("winding_short",),
                "with growth_s"),
    FailureMode("Solder joints", "Intermittent contact", "hybrid", ("winding_open",),
                "with on_s and off_s"),
)  # fmt: skip
