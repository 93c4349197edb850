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

Faults of the hardware are rows of ``flea_sim_driver.plant_faults``. Which of them a machine can
have, and at which sizes, stands in its file. Sensor faults of every channel and mode follow from
its ``sensor_faults``.
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
from flea_sim_driver.plant.coefficients import Coefficients
from flea_sim_driver.plant_faults import PLANT_FAULTS, Numbers, PlantFault

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
