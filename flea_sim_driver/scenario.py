"""A scenario: what the stand is to do, as frozen values read from YAML and checked.

Everything is refused before anything moves, by name, value and limit.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import yaml

from flea_diag.errors import ConfigurationError
from flea_diag.wire.parameters import build, parameter
from flea_sim_driver import faults
from flea_sim_driver.flight import Flight, read_flight
from flea_sim_driver.unit import Spread

NEWTON_PER_POUND = 4.4482216152605
LOAD_LIMIT_N = 70.0 * NEWTON_PER_POUND
STROKE_M = 0.100
REFERENCE_SPEED_LIMIT_M_S = 0.200  # the soft position loop follows at two thirds of it
FILE_LIMIT_BYTES = 1 << 20
DEFAULT_EPOCH_S = 1283529600  # 2010-09-03T16:00:00Z, a day of the stand's public recordings
MOTIONS = ("sine", "trapezoid", "triangle", "sweep", "hold", "flight")


@dataclass(frozen=True)
class Motion:
    """Commanded position over time."""

    kind: str = parameter("sine", "shape of the commanded position", choices=MOTIONS)
    amplitude_m: float = parameter(
        0.0218, "half of the peak-to-peak command", unit="m", minimum=0.0, maximum=0.05
    )
    frequency_hz: float = parameter(
        0.5, "cycles per second (of a sweep: at its start)", unit="Hz", minimum=0.005, maximum=5.0
    )
    end_frequency_hz: float = parameter(
        1.0, "frequency at the end of a sweep", unit="Hz", minimum=0.005, maximum=5.0
    )
    centre_m: float = parameter(0.045, "mean position", unit="m", minimum=0.0, maximum=STROKE_M)
    rise_s: float = parameter(
        1.0, "time of one ramp of a trapezoid", unit="s", minimum=0.05, maximum=60.0
    )
    file: str = parameter("", "flight: a CSV with time_s, position_m, load_N, or a bag")
    fit: bool = parameter(False, "scale a flight into stroke and load limits")


@dataclass(frozen=True)
class Load:
    """Commanded load; positive opposes extension."""

    constant_n: float = parameter(
        0.0, "constant part", unit="N", minimum=-LOAD_LIMIT_N, maximum=LOAD_LIMIT_N
    )
    amplitude_n: float = parameter(
        0.0, "sinusoidal part", unit="N", minimum=0.0, maximum=LOAD_LIMIT_N
    )
    frequency_hz: float = parameter(0.1, "of that part", unit="Hz", minimum=0.001, maximum=2.0)


@dataclass(frozen=True)
class Sensors:
    """How the DAQ samples."""

    voltage: str = parameter(
        "mean",
        "mean: averaged over each scan, synchronous drive; instant_pwm: raw PWM sampled once a "
        "scan, freewheeling drive, as on the public FLEA recordings",
        choices=("mean", "instant_pwm"),
    )
    vibration: bool = parameter(True, "sample the accelerometers")
    vibration_rate_hz: float = parameter(
        20000.0, "of each axis", unit="Hz", minimum=2000.0, maximum=64000.0
    )
    jitter_s: float = parameter(
        0.0, "standard deviation of the scan clock", unit="s", minimum=0.0, maximum=0.002
    )
    scan_loss: float = parameter(0.0, "share of scans lost", minimum=0.0, maximum=0.5)
    spikes: bool = parameter(True, "single-sample outliers of the thermocouples")
    defective: str = parameter(
        "", "channel of the DAQ that is bad from the first sample (reads -24), a data-quality case"
    )


@dataclass(frozen=True)
class Switch:
    """Change of the active test actuator in mid-run."""

    at_s: float = parameter(-1.0, "time of the change, -1: never", unit="s", minimum=-1.0)
    to: str = parameter("X", "test actuator in use from then on", choices=("X", "Y"))


@dataclass(frozen=True)
class FaultSetting:
    """One fault of the catalogue, when, where and how large."""

    fault: str = parameter("", "id of the catalogue")
    onset_s: float = parameter(0.0, "time of onset", unit="s", minimum=0.0)
    size: float = parameter(float("nan"), "see the catalogue; left out: its default")
    growth_s: float = parameter(0.0, "time over which it grows to its size", unit="s", minimum=0.0)
    on_s: float = parameter(0.0, "intermittent: time present, 0: always", unit="s", minimum=0.0)
    off_s: float = parameter(0.0, "intermittent: time absent", unit="s", minimum=0.0)
    unit: str = parameter(
        "", "test actuator that has it (hardware), empty: the one in use", choices=("", "X", "Y")
    )
    where: str = parameter(
        "", "plant, daq or loop; empty: as in the catalogue", choices=("", "plant", "daq", "loop")
    )


@dataclass(frozen=True)
class Run:
    """The plain values of a scenario."""

    name: str = parameter("scenario", "for people")
    duration_s: float = parameter(30.0, "length", unit="s", minimum=0.1, maximum=86400.0)
    seed: int = parameter(1, "of all randomness", minimum=0, maximum=2**63 - 1)
    start_s: float = parameter(
        float(DEFAULT_EPOCH_S), "Unix time of the first sample", unit="s", minimum=1e8, maximum=9e9
    )
    unit_spread: float = parameter(
        1.0, "scale of the differences between units, 0: all nominal", minimum=0.0, maximum=3.0
    )
    active_unit: str = parameter("Y", "test actuator in use at the start", choices=("X", "Y"))
    ambient_degc: float = parameter(23.6, "room", unit="degC", minimum=-40.0, maximum=60.0)
    warm_degc: float = parameter(
        2.0, "motor above the room at the start", unit="K", minimum=0.0, maximum=60.0
    )


@dataclass(frozen=True)
class Scenario:
    """What the stand is to do."""

    run: Run = field(default_factory=Run)
    motion: Motion = field(default_factory=Motion)
    load: Load = field(default_factory=Load)
    sensors: Sensors = field(default_factory=Sensors)
    switch: Switch = field(default_factory=Switch)
    spread: Any = field(default_factory=Spread)
    faults: tuple[FaultSetting, ...] = ()
    flight: Flight | None = None


SECTIONS: dict[str, type] = {
    "motion": Motion, "load": Load, "sensors": Sensors, "switch": Switch, "spread": Spread,
}  # fmt: skip


def scenario_from_mapping(values: Mapping[str, Any], where: str, folder: Path = Path()) -> Scenario:
    """A checked scenario.

    Raises
    ------
    ConfigurationError
        Unknown key, wrong type, value out of its limits, or a run that the stand cannot follow.
    """
    plain = {k: v for k, v in values.items() if k not in SECTIONS and k != "faults"}
    sections: dict[str, Any] = {
        name: build(kind, _mapping(values.get(name, {}), where, name), f"{where}: {name}")
        for name, kind in SECTIONS.items()
    }
    rows = values.get("faults", [])
    if not isinstance(rows, list):
        raise ConfigurationError(f"{where}: faults must be a list, not a {type(rows).__name__}")
    settings = tuple(
        build(FaultSetting, _mapping(row, where, f"faults[{k}]"), f"{where}: faults[{k}]")
        for k, row in enumerate(rows)
    )
    motion: Motion = sections["motion"]
    flight = _flight(motion, where, folder)
    scenario = Scenario(build(Run, plain, where), faults=settings, flight=flight, **sections)
    return checked_scenario(scenario, where)


def _flight(motion: Motion, where: str, folder: Path) -> Flight | None:
    if motion.kind != "flight":
        return None
    if not motion.file:
        raise ConfigurationError(f"{where}: motion.file is empty, a flight needs a CSV or a bag")
    return read_flight(folder / motion.file, fit=motion.fit)


def _mapping(value: Any, where: str, name: str) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise ConfigurationError(
            f"{where}: {name} = {value!r} must be a mapping, not a {type(value).__name__}"
        )
    return value


def checked_scenario(scenario: Scenario, where: str) -> Scenario:
    """The scenario with every fault's size filled in, or a refusal."""
    _check_motion(scenario, where)
    _check_load(scenario, where)
    _check_stand(scenario, where)
    settings = tuple(check_fault(row, scenario.run.duration_s, where) for row in scenario.faults)
    _check_units(scenario, where)
    return replace(scenario, faults=settings)


def _check_motion(scenario: Scenario, where: str) -> None:
    motion = scenario.motion
    if motion.kind == "flight":
        return  # checked row by row when it was read
    reach = 0.0 if motion.kind == "hold" else motion.amplitude_m
    low, high = motion.centre_m - reach, motion.centre_m + reach
    if low < 0.0 or high > STROKE_M:
        raise ConfigurationError(
            f"{where}: motion from {low:.4f} to {high:.4f} m passes the end stops at 0 and "
            f"{STROKE_M} m; lower amplitude_m or move centre_m"
        )
    if motion.kind == "trapezoid" and 2.0 * motion.rise_s * motion.frequency_hz > 1.0:
        raise ConfigurationError(
            f"{where}: motion.rise_s = {motion.rise_s!r} s does not fit twice into the period "
            f"of {1.0 / motion.frequency_hz:.3f} s"
        )
    speed = peak_speed(motion) if reach else 0.0
    if speed > REFERENCE_SPEED_LIMIT_M_S:
        raise ConfigurationError(
            f"{where}: motion reaches {speed:.3f} m/s, the limit is "
            f"{REFERENCE_SPEED_LIMIT_M_S} m/s; lower amplitude_m or frequency_hz"
        )


def peak_speed(motion: Motion) -> float:
    """Greatest speed of the command (of a trapezoid: of its smoothed ramp)."""
    if motion.kind == "trapezoid":
        return 1.875 * 2.0 * motion.amplitude_m / motion.rise_s
    frequency = motion.frequency_hz
    if motion.kind == "sweep":
        frequency = max(frequency, motion.end_frequency_hz)
    if motion.kind == "triangle":
        return 4.0 * motion.amplitude_m * frequency * 1.1
    return 6.283185307179586 * motion.amplitude_m * frequency


def _check_load(scenario: Scenario, where: str) -> None:
    peak = abs(scenario.load.constant_n) + scenario.load.amplitude_n
    if peak > LOAD_LIMIT_N:
        raise ConfigurationError(
            f"{where}: load reaches {peak:.1f} N, the limit is {LOAD_LIMIT_N:.1f} N (70 lb)"
        )


def _check_stand(scenario: Scenario, where: str) -> None:
    samples = scenario.sensors.vibration_rate_hz * 0.1
    if samples != round(samples):
        raise ConfigurationError(
            f"{where}: sensors.vibration_rate_hz = {scenario.sensors.vibration_rate_hz!r} Hz must "
            "be a multiple of 10 Hz, so that a block of 0.1 s is whole"
        )
    if scenario.switch.at_s > scenario.run.duration_s:
        raise ConfigurationError(
            f"{where}: switch.at_s = {scenario.switch.at_s!r} s is after the end at "
            f"{scenario.run.duration_s!r} s"
        )
    if scenario.sensors.defective and scenario.sensors.defective not in faults.SENSOR_CHANNELS:
        raise ConfigurationError(
            f"{where}: sensors.defective = {scenario.sensors.defective!r} is no channel, known "
            f"are {', '.join(faults.SENSOR_CHANNELS)}"
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


def check_fault(setting: FaultSetting, duration_s: float, where: str) -> FaultSetting:
    """The setting with its size and place filled in from the catalogue.

    Raises
    ------
    ConfigurationError
        Unknown fault, onset after the end, size out of its limits, or a fault that cannot
        act in the place asked for.
    """
    row = faults.fault_named(setting.fault, where)
    if setting.unit and row.change is None:
        raise ConfigurationError(
            f"{where}: {setting.fault}: unit = {setting.unit!r}, a sensor belongs to the stand and "
            "not to one unit; leave it out"
        )
    if setting.onset_s >= duration_s:
        raise ConfigurationError(
            f"{where}: {setting.fault}: onset_s = {setting.onset_s!r} s is not before the end "
            f"at {duration_s!r} s"
        )
    size = row.default_size if setting.size != setting.size else setting.size
    if not row.minimum <= size <= row.maximum:
        raise ConfigurationError(
            f"{where}: {setting.fault}: size = {size!r} {row.size_unit} is outside its limits "
            f"{row.minimum!r} to {row.maximum!r} {row.size_unit}"
        )
    if (setting.on_s > 0.0) != (setting.off_s > 0.0):
        raise ConfigurationError(
            f"{where}: {setting.fault}: an intermittent fault needs both on_s and off_s above 0"
        )
    place = setting.where or row.places[0]
    if place not in row.places:
        raise ConfigurationError(
            f"{where}: {setting.fault}: where = {place!r} is not possible, it acts in "
            f"{', '.join(row.places)}"
        )
    return replace(setting, size=float(size), where=place)


def scenario_to_mapping(scenario: Scenario) -> dict[str, Any]:
    """What ``scenario_from_mapping`` makes the same scenario of; defaults are left out."""
    values = _changed(scenario.run)
    for name in SECTIONS:
        section = _changed(getattr(scenario, name))
        if section:
            values[name] = section
    if scenario.faults:
        values["faults"] = [_changed(row) for row in scenario.faults]
    return values


def _changed(section: Any) -> dict[str, Any]:
    """Fields that differ from their defaults; a size that was left out is not a number."""
    return {
        entry.name: value
        for entry in fields(section)
        for value in (getattr(section, entry.name),)
        if value != entry.default and value == value
    }


def load_scenario(path: Path) -> Scenario:
    """Read and check one scenario file.

    Raises
    ------
    ConfigurationError
        The file cannot be read, is too large, is not YAML, or says something impossible.
    """
    try:
        if path.stat().st_size > FILE_LIMIT_BYTES:
            raise ConfigurationError(
                f"{path}: {path.stat().st_size} bytes, the limit is {FILE_LIMIT_BYTES}"
            )
        values = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigurationError(f"{path}: cannot be read: {error}") from error
    except (yaml.YAMLError, RecursionError) as error:
        reason = " ".join(str(error).split())
        raise ConfigurationError(f"{path}: not valid YAML: {reason}") from error
    if values is None:
        values = {}
    where = str(path)
    return scenario_from_mapping(_mapping(values, where, "the file"), where, path.parent)
