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

"""Checks that the stand can follow a scenario; refused before anything moves otherwise.

Each refusal names the value and its limit.
"""

from __future__ import annotations

from dataclasses import replace

from flea_diag.errors import ConfigurationError, shown
from flea_sim_driver import faults
from flea_sim_driver.machine.machine import Limits
from flea_sim_driver.scenario.holding import SLOWS_S
from flea_sim_driver.scenario.profile import Peaks, peaks
from flea_sim_driver.scenario.scenario import Scenario
from flea_sim_driver.scenario.settings import FaultSetting, HardStops


def checked_scenario(scenario: Scenario, where: str) -> Scenario:
    """Check a scenario, and fill in the size of every fault."""
    _check_motion(scenario, where)
    _check_load(scenario, where)
    _check_stand(scenario, where)
    settings = tuple(checked_fault(row, scenario, where) for row in scenario.faults)
    _check_units(scenario, where)
    _check_brake(scenario, where)
    return replace(scenario, faults=settings)


def _check_motion(scenario: Scenario, where: str) -> None:
    motion = scenario.motion
    if motion.kind == "flight":
        return  # checked row by row when it was read
    reach = 0.0 if motion.kind == "hold" else motion.amplitude_m
    _check_reach(scenario.travel, motion.centre_m, reach, where)
    if motion.kind == "trapezoid" and 2.0 * motion.rise_s * motion.frequency_hz > 1.0:
        raise ConfigurationError(
            f"{where}: motion.rise_s = {shown(motion.rise_s)} s does not fit twice into the period "
            f"of {1.0 / motion.frequency_hz:.3f} s"
        )
    _check_peaks(peaks(motion), scenario.machine.limits, where)


def _check_reach(travel: HardStops, centre_m: float, reach_m: float, where: str) -> None:
    """The run starts between the stops, and the command passes them by no more than allowed."""
    low, high = centre_m - reach_m, centre_m + reach_m
    beyond = max(travel.low_m - low, high - travel.high_m)
    if beyond > travel.overtravel_m * (1.0 + 1e-9):
        raise ConfigurationError(
            f"{where}: motion from {low:.4f} to {high:.4f} m passes the end stops at "
            f"{travel.low_m:g} and {travel.high_m:g} m by {beyond:.4f} m; lower amplitude_m, move "
            f"centre_m, or raise travel.overtravel_m, which is {travel.overtravel_m:g} m"
        )


def _check_peaks(reached: Peaks, limits: Limits, where: str) -> None:
    for value, limit, unit in (
        (reached.speed_m_s, limits.speed_m_s, "m/s"),
        (reached.acceleration_m_s2, limits.acceleration_m_s2, "m/s^2"),
        (reached.jerk_m_s3, limits.jerk_m_s3, "m/s^3"),
    ):
        if value > limit * (1.0 + 1e-9):
            raise ConfigurationError(
                f"{where}: motion reaches {value:.3f} {unit}, the limit is {limit:g} {unit}; lower "
                "amplitude_m or frequency_hz, or raise rise_s"
            )


def _check_load(scenario: Scenario, where: str) -> None:
    peak = abs(scenario.load.constant_n) + scenario.load.amplitude_n
    limit = scenario.machine.limits.load_n
    if peak > limit:
        raise ConfigurationError(f"{where}: load reaches {peak:.1f} N, the limit is {limit:.1f} N")


def _check_stand(scenario: Scenario, where: str) -> None:
    samples = scenario.sensors.vibration_rate_hz * 0.1
    if samples != round(samples):
        raise ConfigurationError(
            f"{where}: sensors.vibration_rate_hz = {scenario.sensors.vibration_rate_hz!r} Hz must "
            "be a multiple of 10 Hz, so that a block of 0.1 s is whole"
        )
    if scenario.switch.at_s > scenario.run.duration_s:
        raise ConfigurationError(
            f"{where}: switch.at_s = {shown(scenario.switch.at_s)} s is after the end at "
            f"{shown(scenario.run.duration_s)} s"
        )
    channels = faults.sensor_channels(scenario.machine)
    if scenario.sensors.defective and scenario.sensors.defective not in channels:
        raise ConfigurationError(
            f"{where}: sensors.defective = {shown(scenario.sensors.defective)} is no channel, "
            f"known are {', '.join(channels)}"
        )


def _check_units(scenario: Scenario, where: str) -> None:
    used = {scenario.run.active_unit}
    if scenario.switch.at_s >= 0.0:
        used.add(scenario.switch.to)
    for row in scenario.faults:
        if row.unit and row.unit not in used:
            raise ConfigurationError(
                f"{where}: {row.fault}: unit {row.unit} is never in use; set active_unit, or "
                f"switch.at_s and switch.to"
            )


def _check_brake(scenario: Scenario, where: str) -> None:
    brake = scenario.brake
    if brake.for_s and not scenario.machine.bench.brake_holds_n:
        raise ConfigurationError(
            f"{where}: brake.for_s = {shown(brake.for_s)} s, but {scenario.machine.name} has no "
            "brake; leave it out, or give the machine bench: brake_holds_n"
        )
    least_s = brake.for_s + 2.0 * SLOWS_S
    if brake.every_s and brake.every_s < least_s:
        raise ConfigurationError(
            f"{where}: brake.every_s = {shown(brake.every_s)} s is less than {least_s:g} s, for_s "
            "and the time to slow down and to start again"
        )


def checked_fault(setting: FaultSetting, scenario: Scenario, where: str) -> FaultSetting:
    """The setting with its size and place filled in from the catalogue.

    Raises
    ------
    ConfigurationError
        Unknown fault, onset after the end, size out of its limits, or a fault that cannot
        act in the place asked for.
    """
    row = faults.fault_named(setting.fault, scenario.machine, where)
    duration_s = scenario.run.duration_s
    if setting.unit and row.change is None:
        raise ConfigurationError(
            f"{where}: {setting.fault}: unit = {shown(setting.unit)}, a sensor belongs to the "
            "stand and not to one unit; leave it out"
        )
    if setting.onset_s >= duration_s:
        raise ConfigurationError(
            f"{where}: {setting.fault}: onset_s = {shown(setting.onset_s)} s is not before the end "
            f"at {shown(duration_s)} s"
        )
    size = row.default_size if setting.size != setting.size else setting.size
    if not row.minimum <= size <= row.maximum:
        raise ConfigurationError(
            f"{where}: {setting.fault}: size = {shown(size)} {row.size_unit} is outside its limits "
            f"{shown(row.minimum)} to {shown(row.maximum)} {row.size_unit}"
        )
    if (setting.on_s > 0.0) != (setting.off_s > 0.0):
        raise ConfigurationError(
            f"{where}: {setting.fault}: an intermittent fault needs both on_s and off_s above 0"
        )
    place = setting.where or row.places[0]
    if place not in row.places:
        raise ConfigurationError(
            f"{where}: {setting.fault}: where = {shown(place)} is not possible, it acts in "
            f"{', '.join(row.places)}"
        )
    return replace(setting, size=float(size), where=place)
