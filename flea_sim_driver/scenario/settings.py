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

"""The sections of a scenario: frozen values with their limits, as YAML and ``--help`` show them.

Defaults and limits that a machine sets are filled in by ``flea_sim_driver.scenario.section``.
"""

from __future__ import annotations

from dataclasses import dataclass

from flea_diag.wire.parameters import parameter

DEFAULT_EPOCH_S = 1283529600  # 2010-09-03T16:00:00Z, a day of the stand's public recordings
MOTIONS = ("sine", "trapezoid", "triangle", "sweep", "hold", "flight")


@dataclass(frozen=True)
class Motion:
    """Commanded position over time."""

    kind: str = parameter("sine", "shape of the commanded position", choices=MOTIONS)
    amplitude_m: float = parameter(0.0, "half of the peak-to-peak command", unit="m", minimum=0.0)
    frequency_hz: float = parameter(
        0.5, "cycles per second (of a sweep: at its start)", unit="Hz", minimum=0.005, maximum=5.0
    )
    end_frequency_hz: float = parameter(
        1.0, "frequency at the end of a sweep", unit="Hz", minimum=0.005, maximum=5.0
    )
    centre_m: float = parameter(0.0, "mean position", unit="m", minimum=0.0)
    rise_s: float = parameter(
        1.0, "time of one ramp of a trapezoid", unit="s", minimum=0.05, maximum=60.0
    )
    start_s: float = parameter(
        0.5, "time over which motion and load swell from rest", unit="s", minimum=0.05, maximum=60.0
    )
    file: str = parameter("", "flight: a CSV with time_s, position_m, load_N, or a bag")
    profile: str = parameter("", "flight: a control surface of --list, in place of a file")
    fit: bool = parameter(False, "scale a flight into stroke and load limits")


@dataclass(frozen=True)
class HardStops:
    """Hard stops at the ends of travel, and how far the command may pass them."""

    stopped: str = parameter(
        "load_side",
        "part that the stops hold: load_side, beyond the load cell, which reads their reaction; "
        "nut: no sensor reads it",
        choices=("load_side", "nut"),
    )
    low_m: float = parameter(0.0, "position of the lower stop", unit="m", minimum=0.0)
    high_m: float = parameter(0.0, "position of the upper stop", unit="m")
    overtravel_m: float = parameter(
        0.0, "how far the command may pass the stops", unit="m", minimum=0.0
    )


@dataclass(frozen=True)
class Load:
    """Commanded load; positive opposes extension."""

    constant_n: float = parameter(0.0, "constant part", unit="N")
    amplitude_n: float = parameter(0.0, "sinusoidal part", unit="N", minimum=0.0)
    frequency_hz: float = parameter(0.1, "of that part", unit="Hz", minimum=0.001, maximum=2.0)
    payload_kg: float = parameter(0.0, "on the load side", unit="kg", minimum=0.0)


@dataclass(frozen=True)
class Brake:
    """When the holding brake is engaged: the motion slows down before, and the drive is off."""

    first_s: float = parameter(0.0, "when it engages first", unit="s", minimum=0.0)
    for_s: float = parameter(0.0, "for how long; 0: never", unit="s", minimum=0.0)
    every_s: float = parameter(0.0, "how often; 0: once", unit="s", minimum=0.0)


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
    magnet_s: float = parameter(
        0.0,
        "time constant L/R of the electromagnet that couples it to the load, 0: held at once",
        unit="s",
        minimum=0.0,
        maximum=2.0,
    )
    magnet_n: float = parameter(
        2000.0, "pull of the magnet in the end", unit="N", minimum=100.0, maximum=1e5
    )
    warmer_k: float = parameter(
        0.0, "by how much it is warmer at the start than the other", unit="K", minimum=-20.0,
        maximum=60.0,
    )  # fmt: skip


@dataclass(frozen=True)
class FaultSetting:
    """One fault of the catalogue, when, where and how large."""

    fault: str = parameter("", "id of the catalogue")
    onset_s: float = parameter(0.0, "time of onset", unit="s", minimum=0.0)
    size: float = parameter(float("nan"), "see the catalogue; left out: its default")
    growth_s: float = parameter(0.0, "time over which it grows to its size", unit="s", minimum=0.0)
    on_s: float = parameter(0.0, "intermittent: time present, 0: always", unit="s", minimum=0.0)
    off_s: float = parameter(0.0, "intermittent: time absent", unit="s", minimum=0.0)
    irregular: float = parameter(
        0.0,
        "intermittent: share of off_s by which it comes later in each cycle, at random",
        minimum=0.0,
        maximum=1.0,
    )
    unit: str = parameter(
        "", "test actuator that has it (hardware), empty: the one in use", choices=("", "X", "Y")
    )
    where: str = parameter(
        "", "plant, daq or loop; empty: as in the catalogue", choices=("", "plant", "daq", "loop")
    )


@dataclass(frozen=True)
class RunSettings:
    """The plain values of a scenario."""

    name: str = parameter("scenario", "for people")
    duration_s: float = parameter(30.0, "length", unit="s", minimum=0.1, maximum=86400.0)
    machine: str = parameter("flea", "simulated machine: name of a shipped one, or a YAML file")
    seed: int = parameter(1, "of all randomness", minimum=0, maximum=2**63 - 1)
    unit_seed: int = parameter(
        -1,
        "of the units and their sensors alone, for more runs of the same; -1: the seed",
        minimum=-1,
        maximum=2**63 - 1,
    )
    start_s: float = parameter(
        float(DEFAULT_EPOCH_S), "Unix time of the first sample", unit="s", minimum=1e8, maximum=9e9
    )
    unit_spread: float = parameter(
        1.0, "scale of the differences between units, 0: all nominal", minimum=0.0, maximum=3.0
    )
    serial: str = parameter(
        "", "serial number of the test actuator of the start; empty: one that follows from its seed"
    )
    active_unit: str = parameter("Y", "test actuator in use at the start", choices=("X", "Y"))
    ambient_degc: float = parameter(23.6, "room", unit="degC", minimum=-40.0, maximum=60.0)
    warm_degc: float = parameter(
        2.0, "motor above the room at the start", unit="K", minimum=0.0, maximum=60.0
    )
