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

"""The common failure modes of electro-mechanical actuators, and how this stand shows each.

Modes and approaches are the 25 rows of Narasimhan et al. 2010, Table 1. Every row is simulated by a
fault of the catalogue. A row that does not show at the scan rate says by which sensor it would.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from flea_sim_driver.scenario.scenario import Scenario
from flea_sim_driver.scenario.scenario_file import scenario_from_mapping

ONSET_S, DURATION_S = 10.0, 30.0
MOTION = {"kind": "sine", "amplitude_m": 0.0218, "frequency_hz": 0.5, "centre_m": 0.045}


@dataclass(frozen=True)
class FailureMode:
    """One row.

    Parameters
    ----------
    fault, course
        Of the catalogue, and what its setting says besides: size, growth_s, on_s, off_s.
    effect
        What it does to the actuator.
    found
        By what it is found, or which sensor would show it.
    group
        What a verdict may name: the fault, or what is nearest to it in the catalogue of the stand;
        empty: it does not show at the scan rate.
    vibration
        Whether it takes accelerometers.
    """

    component: str
    mode: str
    approach: str
    fault: str
    effect: str
    found: str
    group: tuple[str, ...]
    course: Mapping[str, float] = field(default_factory=dict)
    vibration: bool = False

    @property
    def name(self) -> str:
        """Of its scenario: component and mode."""
        words = f"{self.component} {self.mode.partition('/')[0]}".lower()
        return "_".join(words.split())

    @property
    def shown(self) -> str:
        """Fault and course in one line."""
        return ", ".join((self.fault, *(f"{k} {v:g}" for k, v in self.course.items())))


SHORTED = ("winding_short",)
OPENED = ("winding_open", "motor_failure")
UNPOWERED = ("supply_open", "supply_short")
RATHER = "; the stand has encoder and potentiometer, no resolver"
CONTACT = "balance of voltages, while it lasts: short gaps ask for a voltage probe at the motor"

FAILURE_MODES: tuple[FailureMode, ...] = (
    FailureMode("Actuator", "Jam", "physics", "jam", "heavy drag, strokes fall short",
                "balance of forces", ("jam", "ball_nut_friction")),
    FailureMode("Actuator", "Spall", "hybrid", "spall", "force ripples as balls pass the pit",
                "accelerometer on the nut", ("spall",), vibration=True),
    FailureMode("Motor", "Winding short", "physics", "winding_short",
                "more current for the same force", "balance of voltages", SHORTED),
    FailureMode("Connectors", "Degraded operation", "data", "winding_resistance_rise",
                "contact resistance in the motor's lead: more volts for the same current",
                "balance of voltages", ("winding_resistance_rise",)),
    FailureMode("Connectors", "Intermittent contact", "data", "winding_open",
                "the current breaks off and returns", CONTACT, OPENED,
                {"on_s": 0.2, "off_s": 1.8}),
    FailureMode("Stator", "Stator coil fails open", "physics", "winding_open",
                "no current, no motion", "balance of voltages", OPENED),
    FailureMode("Stator", "Insulation deterioration / wire chafing", "data", "winding_short",
                "turns are bypassed one after another", "balance of voltages", SHORTED,
                {"size": 0.3, "growth_s": 10.0}),
    FailureMode("Resolver", "Coil fails open", "physics", "actuator_position_dead",
                "the loop drives into a stop" + RATHER, "difference of both positions",
                ("actuator_position_dead",)),
    FailureMode("Resolver", "Intermittent coil failures", "data", "actuator_position_dropout",
                "readings of zero for 50 ms" + RATHER, "steps of the position",
                ("actuator_position_dropout",)),
    FailureMode("Sensor", "Insulation deterioration / wire chafing", "data",
                "motor_current_noise", "interference grows on the reading",
                "noise of the channel", ("motor_current_noise",), {"growth_s": 10.0}),
    FailureMode("Sensor", "Bias", "physics", "motor_current_bias",
                "the reading is off, as on any channel", "balance of forces",
                ("motor_current_bias",)),
    FailureMode("Sensor", "Scaling", "physics", "motor_current_scaling",
                "the gain of the reading is wrong", "balance of forces",
                ("motor_current_scaling",)),
    FailureMode("Sensor", "Drift", "data", "motor_temperature_drift",
                "the reading wanders off", "heat balance of the motor",
                ("motor_temperature_drift",)),
    FailureMode("Power supply", "Noise", "data", "supply_noise",
                "the bridge passes the ripple on: 120 Hz, 10 %",
                "not here: a scan averages it; a probe of the supply at 1 kHz would", ()),
    FailureMode("Power supply", "Intermittent dropout", "physics", "supply_open",
                "the motor coasts and is driven again", "voltage against command, while it lasts",
                (*UNPOWERED, "supply_sag"), {"on_s": 0.2, "off_s": 1.8}),
    FailureMode("Power supply", "Short circuit", "hybrid", "supply_short",
                "the motor brakes itself", "voltage against command", UNPOWERED),
    FailureMode("Power supply", "Open circuit", "hybrid", "supply_open", "the motor coasts",
                "voltage against command", UNPOWERED),
    FailureMode("Controller capacitors", "Intermittent performance", "data", "capacitor_loss",
                "the link is drained between the peaks of the rectifier, by the motor's power",
                "voltage against command, while it lasts", ("supply_sag",),
                {"on_s": 0.5, "off_s": 1.5}),
    FailureMode("Controller capacitors", "Thermal runaway", "hybrid", "capacitor_runaway",
                "nothing while it heats, then a short across the link",
                "voltage against command, once it has shorted; a thermocouple on it would before",
                UNPOWERED, {"growth_s": 8.0}),
    FailureMode("Controller capacitors", "Dielectric breakdown", "hybrid", "supply_short",
                "a shorted link, as a shorted supply", "voltage against command", UNPOWERED),
    FailureMode("Controller transistors", "Dielectric breakdown", "hybrid",
                "transistor_breakdown", "one leg of the bridge gives less, one way alone",
                "voltage against command; which leg, a probe on both would tell",
                ("supply_sag",), {"size": 0.5}),
    FailureMode("Controller transistors", "Short circuit", "hybrid", "supply_short",
                "a shorted half bridge shorts the rail", "voltage against command", UNPOWERED),
    FailureMode("Wiring", "Open circuit", "hybrid", "winding_open", "no current, no motion",
                "balance of voltages", OPENED),
    FailureMode("Wiring", "Insulation deterioration / wire chafing", "data", "lead_leak",
                "current from lead to lead, past the motor",
                "balances of forces and voltages; while it is small it looks like drag", SHORTED,
                {"size": 0.1, "growth_s": 10.0}),
    FailureMode("Solder joints", "Intermittent contact", "hybrid", "winding_open",
                "gaps of 50 ms, as in a cracked joint", CONTACT,
                (*OPENED, "winding_resistance_rise"),
                {"on_s": 0.05, "off_s": 0.95}),
)  # fmt: skip


def table1(seed: int) -> tuple[Scenario, ...]:
    """A scenario of each row on the FLEA, all of one unit and with one motion."""
    return tuple(_scenario(mode, seed) for mode in FAILURE_MODES)


def _scenario(mode: FailureMode, seed: int) -> Scenario:
    values: dict[str, Any] = {
        "name": mode.name, "seed": seed, "duration_s": DURATION_S, "motion": MOTION,
        "sensors": {"vibration": mode.vibration},
        "faults": [{"fault": mode.fault, "onset_s": ONSET_S, **mode.course}],
    }  # fmt: skip
    return scenario_from_mapping(values, f"Table 1, {mode.component}, {mode.mode}")
