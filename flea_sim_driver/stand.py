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

"""The simulated stand: a scenario in, the records of its DAQ out, in stamp order.

``for record in SimulatedStand(scenario): ...`` runs as fast as possible; the DAQ node paces the
same blocks in real time. Equal scenario and start give equal bytes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import asdict, replace
from functools import partial

import numpy as np
import numpy.typing as npt

from flea_diag.wire.records import NEVER_NS, ChannelTable, Record, Scan, Truth, VibrationBlock
from flea_diag.wire.topics import TOPIC_OF
from flea_sim_driver.acquisition.acquisition import Acquisition, Block, pwm
from flea_sim_driver.acquisition.sensors import ACCELEROMETER_AXES, Instruments, channel_infos
from flea_sim_driver.faults import catalogue
from flea_sim_driver.machine.machine import BLOCK_S
from flea_sim_driver.plant.actuator import ActuatorPlant, Sizes, coefficients, with_faults
from flea_sim_driver.plant.coefficients import Coefficients
from flea_sim_driver.plant.disturbance import Disturbance
from flea_sim_driver.plant.plant import STEP_S
from flea_sim_driver.plant.thermal import Temperatures, warmed
from flea_sim_driver.plant.unit import SimulatedUnit, draw_unit
from flea_sim_driver.plant.vibration import Vibration
from flea_sim_driver.scenario.feasibility import checked_fault
from flea_sim_driver.scenario.holding import GRIPS_S, engaged, magnet_holds_n
from flea_sim_driver.scenario.profile import commanded
from flea_sim_driver.scenario.scenario import Scenario
from flea_sim_driver.scenario.settings import FaultSetting
from flea_sim_driver.schedule import FaultCourse, cleared, courses, on_grid

Array = npt.NDArray[np.float64]
Command = Callable[[Array], tuple[Array, Array]]
STEPS = round(BLOCK_S / STEP_S)
BLOCK_NS = 100_000_000
LATEST_SHARE = 0.4
"""Largest jitter of a scan, as a share of the scan period."""
NOMINAL = "nominal"


class SimulatedStand:
    """Test actuators X and Y, load actuator Z, sensors and DAQ of one run.

    Parameters
    ----------
    scenario
        A checked scenario.
    start_ns
        Stamp of the first sample; by default the start of the scenario.
    command
        Position in m and load in N at times in s after the start, called block by block in place
        of the motion of the scenario.

    Attributes
    ----------
    block
        True signals of the latest block; None before the first.
    """

    def __init__(
        self, scenario: Scenario, start_ns: int | None = None, command: Command | None = None
    ) -> None:
        self.scenario = scenario
        self._command = command or partial(commanded, scenario)
        machine, run, sensors = scenario.machine, scenario.run, scenario.sensors
        self._machine, self._sampling = machine, machine.sampling
        self.start_ns = round(run.start_s * 1e9) if start_ns is None else start_ns
        draws = _generators(run.seed)
        # What differs between units and stands is drawn by a seed of its own where it is given.
        own = draws if run.unit_seed < 0 else _generators(run.unit_seed)
        warm = run.ambient_degc + run.warm_degc
        spread = {k: run.unit_spread * sigma for k, sigma in asdict(scenario.spread).items()}
        self.units: dict[str, SimulatedUnit] = {
            "Y": draw_unit(machine.unit, own[0], spread),
            "X": draw_unit(machine.unit, own[1], spread),
        }
        travel = scenario.travel
        self.bench = replace(
            machine.bench,
            travel_low_m=travel.low_m, travel_high_m=travel.high_m, stopped=travel.stopped,
            payload_kg=scenario.load.payload_kg,
        )  # fmt: skip
        self.unit_in_use = run.active_unit
        panel = Instruments(machine, own[2], draws[2], run.unit_spread, sensors.spikes)
        self._acquisition = Acquisition(sensors, machine, panel, draws[5])
        self._clock = draws[6]
        self._vibrations = _vibrations(scenario, own[7:9], draws[3])
        self._disturbance = Disturbance(draws[4], machine.catches)
        self._temperatures = {
            name: Temperatures.uniform(
                warm + scenario.switch.warmer_k * (name != run.active_unit), run.ambient_degc
            )
            for name in self.units
        }
        self._courses = courses(scenario)
        self._told: set[int] = set()
        self._tell_nominal = True
        self._block = 0
        self.block: Block | None = None
        position, _ = commanded(scenario, np.zeros(1))
        start_m = float(np.clip(position[0], travel.low_m, travel.high_m))
        c = coefficients(self.units[run.active_unit], self.bench)
        pull = c.weight + c.link_moment * float(np.cos(start_m - c.link_level))
        holds_v = pull / c.force_constant * (c.resistance + c.droop)
        self._actuator = ActuatorPlant.at_rest(self.bench, start_m, holds_v)

    # -- running ---------------------------------------------------------------------------

    def __iter__(self) -> Iterator[Record]:
        while not self.finished:
            yield from self.advance()

    @property
    def time_s(self) -> float:
        """Time since the start at which the next block begins."""
        return self._block * BLOCK_S

    @property
    def scan_ns(self) -> int:
        """Scan period in ns."""
        return self._sampling.scan_ns

    @property
    def finished(self) -> bool:
        """Whether the scenario's duration has been delivered."""
        return self.time_s >= self.scenario.run.duration_s - 1e-9

    def advance(self) -> tuple[Record, ...]:
        """Records of the next block of 0.1 s, in stamp order."""
        records = self._opening() + self._truths()
        self.unit_in_use = self.scenario.unit_at(self.time_s)
        before = self._temperatures[self.unit_in_use]
        self.block = block = self._run()
        after = self._warm(block)
        records += self._stamped(self._acquisition.read(block, before, after))
        if self.scenario.sensors.vibration:
            records.append(self._shake(block))
        self._block += 1
        records.sort(key=lambda record: (record.stamp_ns, TOPIC_OF[type(record)].rank))
        return tuple(records)

    @property
    def winding_degc(self) -> float:
        """True temperature of the winding in use."""
        return self._temperatures[self.unit_in_use].winding

    # -- faults, live ----------------------------------------------------------------------

    def injection(self, fault: str, size: float = float("nan"), **options: str) -> FaultSetting:
        """Checked setting of a fault beginning with the next block; it is not injected.

        Raises
        ------
        ConfigurationError
            The catalogue has no such fault, or its size or place is impossible.
        """
        onset_s = on_grid(self.time_s, self._sampling.scan_s)
        setting = FaultSetting(fault, onset_s, size, **options)  # type: ignore[arg-type]
        return checked_fault(setting, self.scenario, "inject")

    def inject(self, fault: str, size: float = float("nan"), **options: str) -> Truth:
        """Inject a fault at the next block; ``options``: ``where``, ``unit``."""
        setting = self.injection(fault, size, **options)
        row = catalogue(self._machine)[fault]
        course = FaultCourse(setting, row, setting.onset_s, seed=self.scenario.run.seed)
        self._courses += (course,)
        return self._truth(course)

    def clear(self) -> None:
        """End every fault at the next block."""
        now = on_grid(self.time_s, self._sampling.scan_s)
        self._tell_nominal |= any(e.onset_s < now < e.end_s for e in self._courses)
        self._courses = tuple(cleared(course, now) for course in self._courses)

    # -- parts of one block ----------------------------------------------------------------

    def _run(self) -> Block:
        """The true signals of this block."""
        begin, name = self.time_s, self.unit_in_use
        unit = warmed(self.units[name], self._machine.heat, self._temperatures[name])
        scan_s = self._sampling.scan_s
        times = [begin + k * scan_s + 1e-9 for k in range(self._sampling.scans)]
        sizes = [tuple(e.size_at(time, name) for e in self._courses) for time in times]
        position, load = self._command(np.arange(STEPS, dtype=np.float64) * STEP_S + begin)
        brake, at_s = self.scenario.brake, np.array(times)
        held = engaged(brake, at_s, GRIPS_S).tolist()
        pulls = magnet_holds_n(self.scenario.switch, at_s).tolist()
        signals = self._actuator.advance(
            self._segments(coefficients(unit, self.bench, begin), sizes, held, pulls),
            position,
            load,
            self._disturbance.block(STEPS, float(load[0]), BLOCK_S),
        )
        told = engaged(brake, at_s).astype(np.float64)
        return Block(begin, unit, signals, position, load, self._courses, sizes, told)

    def _segments(
        self, healthy: Coefficients, sizes: list[Sizes], held: list[bool], pulls: list[float]
    ) -> list[tuple[int, Coefficients]]:
        """One stretch of constant coefficients, or one a scan where a fault changes in it."""
        changing = any(
            e.row.mode in ("drift", "dropout") and e.setting.where == "loop" for e in self._courses
        )
        alike = all(rows.count(rows[0]) == len(rows) for rows in (sizes, held, pulls))
        if not changing and alike:
            healthy = healthy._replace(coupling_holds=pulls[0])
            return [(STEPS, self._faulty(healthy, sizes[0], held[0], self.time_s))]
        scan_s = self._sampling.scan_s
        return [
            (STEPS // len(sizes), self._faulty(
                healthy._replace(coupling_holds=pull), row, brake, self.time_s + k * scan_s))
            for k, (row, brake, pull) in enumerate(zip(sizes, held, pulls, strict=True))
        ]  # fmt: skip

    def _faulty(
        self, healthy: Coefficients, sizes: Sizes, held: bool, time_s: float
    ) -> Coefficients:
        """Coefficients with the faults of a moment; the brake holds with the drive off."""
        changed = with_faults(healthy, self._courses, sizes, time_s)
        if not held:
            return changed
        return changed._replace(coulomb=changed.coulomb + self.bench.brake_holds_n, bridge=0.0)

    def _warm(self, block: Block) -> Temperatures:
        """Temperatures at the end of the block; the idle unit cools."""
        square = float(np.mean(block.column("current") ** 2))
        if self.scenario.sensors.voltage == "instant_pwm":
            square = float(np.mean(pwm(block, self.bench).mean_square_current()))
        losses = {
            self.unit_in_use: (
                square * block.unit.winding_resistance_ohm,
                float(np.mean(block.column("friction_power"))),
            )
        }
        for name, now in self._temperatures.items():
            copper, friction = losses.get(name, (0.0, 0.0))
            self._temperatures[name] = now.after(
                BLOCK_S, self.units[name], self._machine.heat, copper, friction
            )
        return self._temperatures[self.unit_in_use]

    def _stamped(self, values: Array) -> list[Record]:
        sensors = self.scenario.sensors
        base = self.start_ns + self._block * BLOCK_NS
        count, scan_ns = len(values), self._sampling.scan_ns
        late, kept = np.zeros(count), np.ones(count, dtype=bool)
        if sensors.jitter_s > 0.0:
            jitter = self._clock.standard_normal(count) * sensors.jitter_s
            latest_s = LATEST_SHARE * self._sampling.scan_s
            late = np.clip(jitter, -latest_s, latest_s)
        if sensors.scan_loss > 0.0:
            kept = self._clock.random(count) >= sensors.scan_loss
        rows = values.tolist()
        return [
            Scan(base + k * scan_ns + round(late[k] * 1e9), self._machine.channels, tuple(rows[k]))
            for k in range(count)
            if kept[k]
        ]

    def _shake(self, block: Block) -> VibrationBlock:
        vibration = self._vibrations[self.unit_in_use]
        samples = vibration.block(
            block.unit,
            block.column("speed"),
            block.column("position") / block.unit.screw_ratio_m_rad,
            block.column("force"),
            block.severity,
        )
        offsets = np.round(np.arange(vibration.count) * (1e9 / vibration.rate_hz))
        stamp = self.start_ns + self._block * BLOCK_NS
        return VibrationBlock.pack(stamp, ACCELEROMETER_AXES, offsets.astype(np.uint32), samples)

    # -- records besides the data ----------------------------------------------------------

    def _opening(self) -> list[Record]:
        if self._block > 0:
            return []
        # The table names the actuator at the start: a later change would reveal a unit switch.
        sensors, serial = self.scenario.sensors, self.scenario.serial(self.unit_in_use)
        rate = sensors.vibration_rate_hz if sensors.vibration else None
        rows = channel_infos(self._machine, sensors.voltage, rate, serial)
        return [ChannelTable(self.start_ns, f"{self._machine.name}_sim", rows)]

    def _truths(self) -> list[Record]:
        """The faults present: at the start, at each onset, and when all are cleared."""
        told: list[Record] = []
        if self._tell_nominal:
            self._tell_nominal = False
            stamp = self.start_ns + self._block * BLOCK_NS
            told.append(Truth(stamp, NOMINAL, NEVER_NS, self._details()))
        for number, course in enumerate(self._courses):
            if number not in self._told and course.onset_s < self.time_s + BLOCK_S - 1e-6:
                self._told.add(number)
                if course.end_s > course.onset_s:
                    told.append(self._truth(course))
        return told

    def _details(self) -> tuple[tuple[str, str], ...]:
        run = self.scenario.run
        return (("scenario", run.name), ("seed", str(run.seed)))

    def _truth(self, course: FaultCourse) -> Truth:
        onset = self.start_ns + round(course.onset_s * 1e9)
        setting = course.setting
        details = (
            *self._details(),
            (
                "serial",
                self.scenario.serial(setting.unit or self.scenario.unit_at(course.onset_s)),
            ),
            ("size", repr(setting.size)),
            ("size_unit", course.row.size_unit),
            ("where", setting.where),
            ("growth_s", repr(setting.growth_s)),
            ("on_s", repr(setting.on_s)),
            ("off_s", repr(setting.off_s)),
            ("irregular", repr(setting.irregular)),
            ("approach", course.row.approach),
        )
        return Truth(onset, setting.fault, onset, details)


def _generators(seed: int) -> list[np.random.Generator]:
    return [np.random.default_rng(stream) for stream in np.random.SeedSequence(seed).spawn(10)]


def _vibrations(
    scenario: Scenario, structures: list[np.random.Generator], noise: np.random.Generator
) -> dict[str, Vibration]:
    """The accelerometers of both test actuators, each with its own structure."""
    run, rate = scenario.run, scenario.sensors.vibration_rate_hz
    machine = scenario.machine
    spread = scenario.structure.scaled(run.unit_spread)
    return {
        name: Vibration(
            noise,
            machine.vibration,
            spread.draw(machine.structure, draw),
            rate,
            round(rate * BLOCK_S),
        )
        for name, draw in zip(("Y", "X"), structures, strict=True)
    }
