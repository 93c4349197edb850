"""The simulated stand: a scenario in, the records of its DAQ out, in stamp order.

``for record in Stand(scenario): ...`` runs as fast as the machine can; a node paces the same
blocks in real time. The same scenario and start give the same bytes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from flea_diag.wire.records import (
    NEVER_NS,
    ChannelTable,
    Record,
    Scan,
    Truth,
    VibrationBlock,
)
from flea_diag.wire.topics import TOPIC_OF
from flea_sim_driver.actuator import Actuator, Sizes, coefficients, with_faults
from flea_sim_driver.disturbance import Catches, Disturbance
from flea_sim_driver.drive import waveform
from flea_sim_driver.plant import SIGNALS, STEP_S, Coefficients
from flea_sim_driver.profile import commanded
from flea_sim_driver.scenario import FaultSetting, Scenario, check_fault
from flea_sim_driver.schedule import Episode, cleared, episodes, on_grid
from flea_sim_driver.sensors import (
    ACCELEROMETER_AXES,
    CHANNELS,
    COLUMN,
    ENCODER_COUNTS,
    LOAD_CURRENT_OFFSET_A,
    Panel,
    channel_infos,
)
from flea_sim_driver.thermal import Temperatures, warmed
from flea_sim_driver.unit import Bench, Unit, draw_unit
from flea_sim_driver.vibration import Severity, Vibration

Array = npt.NDArray[np.float64]
BLOCK_S = 0.1
SCANS = 10
STEPS = 200
SCAN_NS = 10_000_000
BLOCK_NS = 100_000_000
NOMINAL = "nominal"
DEFECTIVE_READING = -24.0


class Stand:
    """Test actuators X and Y, load actuator Z, sensors and DAQ of one run.

    Parameters
    ----------
    scenario
        What to do; checked.
    start_ns
        Stamp of the first sample; the scenario's own start when left out.
    """

    def __init__(self, scenario: Scenario, start_ns: int | None = None) -> None:
        self.scenario = scenario
        run = scenario.run
        self.start_ns = round(run.start_s * 1e9) if start_ns is None else start_ns
        streams = [np.random.default_rng(s) for s in np.random.SeedSequence(run.seed).spawn(7)]
        warm = run.ambient_degc + run.warm_degc
        self.units: dict[str, Unit] = {
            "Y": draw_unit(streams[0], run.unit_spread, warm),
            "X": draw_unit(streams[1], run.unit_spread, warm),
        }
        self.bench = Bench()
        self.unit_in_use = run.active_unit
        self._panel = Panel(streams[2], run.unit_spread, scenario.sensors.spikes)
        self._disturbance = Disturbance(streams[4], Catches())
        self._daq, self._phase = streams[5], streams[6].random()
        self._temperatures = {name: Temperatures.uniform(warm) for name in self.units}
        self._episodes = episodes(scenario.faults, scenario.switch, run.active_unit)
        self._told: set[int] = set()
        self._block = 0
        rate = scenario.sensors.vibration_rate_hz
        count = round(rate * BLOCK_S)
        self._vibration = Vibration(streams[3], rate, count)
        self._offsets = np.round(np.arange(count) * (1e9 / rate)).astype(np.uint32)
        position, _ = commanded(scenario, np.zeros(1))
        self._actuator = Actuator.at_rest(self.bench, float(position[0]))
        self._counts = self._encoder(np.array([position[0]]), self.units[self.unit_in_use])[0]

    # -- running ---------------------------------------------------------------------------

    def __iter__(self) -> Iterator[Record]:
        while not self.finished:
            yield from self.advance()

    @property
    def time_s(self) -> float:
        """Time since the start at which the next block begins."""
        return self._block * BLOCK_S

    @property
    def finished(self) -> bool:
        """Whether the scenario's duration has been delivered."""
        return self.time_s >= self.scenario.run.duration_s - 1e-9

    def advance(self) -> tuple[Record, ...]:
        """Records of the next block of 0.1 s, in stamp order."""
        begin = self.time_s
        self._switch(begin)
        unit_now = self.units[self.unit_in_use]
        unit = warmed(unit_now, self._temperatures[self.unit_in_use])
        sizes = self._sizes(begin)
        signals, position, load = self._move(unit, sizes, begin)
        records = self._opening() if self._block == 0 else []
        records += self._truths(begin)
        before = self._temperatures[self.unit_in_use]
        heat = self._measure_currents(signals, unit)
        after = self._warm(unit_now, heat, signals)
        records += self._scans(signals, position, load, unit, (before, after), sizes, begin)
        if self.scenario.sensors.vibration:
            records.append(self._shake(signals, unit, sizes))
        self._block += 1
        records.sort(key=lambda record: (record.stamp_ns, TOPIC_OF[type(record)].rank))
        return tuple(records)

    # -- faults, live ----------------------------------------------------------------------

    def inject(self, fault: str, size: float = float("nan"), **options: float | str) -> Truth:
        """Put a fault in at the next block; ``options`` are fields of ``FaultSetting``.

        Raises
        ------
        ConfigurationError
            The catalogue has no such fault, or its size or place is impossible.
        """
        values = {"onset_s": on_grid(self.time_s), **options}
        setting = FaultSetting(fault=fault, size=size, **values)  # type: ignore[arg-type]
        checked = check_fault(setting, self.scenario.run.duration_s, "inject")
        episode = Episode(checked, on_grid(checked.onset_s))
        self._episodes += (episode,)
        return self._truth(episode)

    def clear(self) -> None:
        """End every fault at the next block."""
        now = on_grid(self.time_s)
        self._episodes = tuple(cleared(episode, now) for episode in self._episodes)
        self._told.add(-1)

    # -- parts of one block ----------------------------------------------------------------

    def _switch(self, begin: float) -> None:
        switch = self.scenario.switch
        if 0.0 <= switch.at_s <= begin + 1e-9:
            self.unit_in_use = switch.to

    def _sizes(self, begin: float) -> list[Sizes]:
        """Sizes of all episodes at each scan of the block."""
        times = [begin + k * BLOCK_S / SCANS + 1e-9 for k in range(SCANS)]
        unit = self.unit_in_use
        return [tuple(e.size_at(time, unit) for e in self._episodes) for time in times]

    def _move(self, unit: Unit, sizes: list[Sizes], begin: float) -> tuple[Array, Array, Array]:
        """Plant signals (STEPS, signals) with commanded position and load (STEPS,)."""
        time = begin + np.arange(STEPS) * STEP_S
        position, load = commanded(self.scenario, time)
        noise = self._disturbance.block(STEPS, float(load[0]), BLOCK_S)
        segments = self._segments(coefficients(unit, self.bench), sizes, begin)
        return self._actuator.advance(segments, position, load, noise), position, load

    def _segments(
        self, healthy: Coefficients, sizes: list[Sizes], begin: float
    ) -> list[tuple[int, Coefficients]]:
        drifting = any(e.row.mode == "drift" and e.setting.where == "loop" for e in self._episodes)
        if not drifting and sizes.count(sizes[0]) == SCANS:
            return [(STEPS, with_faults(healthy, self._episodes, sizes[0], begin))]
        step = STEPS // SCANS
        return [
            (step, with_faults(healthy, self._episodes, row, begin + k * BLOCK_S / SCANS))
            for k, row in enumerate(sizes)
        ]

    def _measure_currents(self, signals: Array, unit: Unit) -> float:
        """Copper loss of the block in W, with the ripple that a freewheeling drive adds."""
        current = signals[:, SIGNALS.index("current")]
        square = float(np.mean(current**2))
        if self.scenario.sensors.voltage == "instant_pwm":
            square = float(np.mean(self._pwm(_mean(signals), unit).mean_square_current()))
        return square * unit.winding_resistance_ohm

    def _pwm(self, mean: Array, unit: Unit):  # type: ignore[no-untyped-def]
        reactance = unit.winding_inductance_h * self.bench.pwm_frequency_hz
        emf = unit.force_constant_n_per_a * mean[:, SIGNALS.index("speed")]
        return waveform(
            mean[:, SIGNALS.index("current")], emf, unit.winding_resistance_ohm, reactance,
            self.bench.supply_v, self.bench.freewheel_drop_v,
        )  # fmt: skip

    def _warm(self, unit: Unit, copper_w: float, signals: Array) -> Temperatures:
        """Temperatures at the end of the block; the idle unit cools."""
        friction = float(np.mean(signals[:, SIGNALS.index("friction_power")]))
        room = self.scenario.run.ambient_degc
        for name, now in self._temperatures.items():
            loss = (copper_w, friction) if name == self.unit_in_use else (0.0, 0.0)
            self._temperatures[name] = now.after(BLOCK_S, self.units[name], *loss, room)
        return self._temperatures[self.unit_in_use]

    def _scans(
        self, signals: Array, position: Array, load: Array, unit: Unit,
        temperatures: tuple[Temperatures, Temperatures], sizes: list[Sizes], begin: float,
    ) -> list[Record]:  # fmt: skip
        mean = _mean(signals)
        true = np.empty((SCANS, len(CHANNELS)))
        self._electrical(true, mean, unit, begin)
        self._mechanical(true, mean, signals, unit)
        self._thermal(true, *temperatures)
        true[:, COLUMN["commanded_position"]] = position.reshape(SCANS, -1).mean(axis=1)
        true[:, COLUMN["commanded_load"]] = load.reshape(SCANS, -1).mean(axis=1)
        running = np.minimum(np.abs(mean[:, SIGNALS.index("voltage")]) / 4.0, 1.0)
        values = self._panel.read(true, running)
        if self.scenario.sensors.defective:
            self._defect(values)
        self._falsify(values, sizes, begin)
        return self._stamped(values)

    def _electrical(self, true: Array, mean: Array, unit: Unit, begin: float) -> None:
        current, voltage = (mean[:, SIGNALS.index(s)] for s in ("current", "voltage"))
        if self.scenario.sensors.voltage == "instant_pwm":
            time = begin + np.arange(SCANS) * BLOCK_S / SCANS
            phase = np.mod(self._phase + self.bench.pwm_frequency_hz * time, 1.0)
            wave = self._pwm(mean, unit)
            driven = np.abs(voltage) + np.abs(current) > 1e-6
            current = np.where(driven, wave.current(phase), 0.0)
            voltage = np.where(driven, wave.voltage(phase), 0.0)
        true[:, COLUMN["motor_current"]] = current + unit.current_offset_a
        true[:, COLUMN["motor_voltage"]] = voltage + unit.voltage_offset_v
        true[:, COLUMN["commanded_voltage"]] = mean[:, SIGNALS.index("command")]
        load_current = mean[:, SIGNALS.index("load_current")]
        true[:, COLUMN["load_motor_current"]] = load_current + LOAD_CURRENT_OFFSET_A

    def _encoder(self, position: Array, unit: Unit) -> Array:
        return np.floor(position / unit.lead_m * ENCODER_COUNTS)

    def _mechanical(self, true: Array, mean: Array, signals: Array, unit: Unit) -> None:
        ends = signals[STEPS // SCANS - 1 :: STEPS // SCANS, SIGNALS.index("position")]
        counts = self._encoder(ends, unit)
        turned = np.diff(counts, prepend=self._counts)
        self._counts = counts[-1]
        per_count = 2.0 * np.pi / ENCODER_COUNTS
        true[:, COLUMN["motor_speed"]] = turned * per_count * SCANS / BLOCK_S
        encoder = mean[:, SIGNALS.index("position")] + self._panel.homing_error_m
        true[:, COLUMN["actuator_position"]] = encoder
        pot = self._panel.potentiometer(mean[:, SIGNALS.index("load_position")])
        true[:, COLUMN["load_position"]] = pot
        true[:, COLUMN["load_force"]] = mean[:, SIGNALS.index("force")]

    def _thermal(self, true: Array, before: Temperatures, after: Temperatures) -> None:
        share = np.arange(SCANS) / SCANS
        for channel, name in (("motor", "housing_sensed"), ("nut", "nut_sensed")):
            first, last = getattr(before, name), getattr(after, name)
            true[:, COLUMN[f"{channel}_temperature"]] = first + share * (last - first)
        true[:, COLUMN["ambient_temperature"]] = self.scenario.run.ambient_degc

    def _defect(self, values: Array) -> None:
        column = COLUMN[self.scenario.sensors.defective]
        values[:, column] = DEFECTIVE_READING + 0.05 * self._daq.standard_normal(SCANS)

    def _falsify(self, values: Array, sizes: list[Sizes], begin: float) -> None:
        """Sensor faults, on the digital values."""
        for k, row in enumerate(sizes):
            for episode, size in zip(self._episodes, row):
                if size is not None and episode.row.channel:
                    column = COLUMN[episode.row.channel]
                    age = begin + k * BLOCK_S / SCANS - episode.onset_s
                    values[k, column] = self._faulty(episode, size, values[k, column], age)

    def _faulty(self, episode: Episode, size: float, value: float, age: float) -> float:
        mode = episode.row.mode
        if mode == "dropout":
            # Gaps of 50 ms that begin anywhere, so many a second.
            slot = int((age + 1e-9) / 0.05)
            seed = (self.scenario.run.seed, slot, round(episode.onset_s * 1e3))
            lost = np.random.default_rng(seed).random() < 0.05 * size
            return 0.0 if lost else value
        if mode == "noise":
            return float(value + size * self._daq.standard_normal())
        return {
            "bias": value + size,
            "drift": value + size * age,
            "scaling": value * size,
            "dead": size,
        }[mode]

    def _stamped(self, values: Array) -> list[Record]:
        sensors = self.scenario.sensors
        base = self.start_ns + self._block * BLOCK_NS
        late = np.zeros(SCANS)
        if sensors.jitter_s > 0.0:
            late = np.clip(self._daq.standard_normal(SCANS) * sensors.jitter_s, -4e-3, 4e-3)
        kept = np.ones(SCANS, dtype=bool)
        if sensors.scan_loss > 0.0:
            kept = self._daq.random(SCANS) >= sensors.scan_loss
        rows = values.tolist()
        return [
            Scan(base + k * SCAN_NS + round(late[k] * 1e9), CHANNELS, tuple(rows[k]))
            for k in range(SCANS)
            if kept[k]
        ]

    def _shake(self, signals: Array, unit: Unit, sizes: list[Sizes]) -> VibrationBlock:
        speed, position, force = (
            signals[:, SIGNALS.index(name)] for name in ("speed", "position", "force")
        )
        severity = self._severity(sizes)
        angle = position / unit.screw_ratio_m_rad
        samples = self._vibration.block(unit, speed, angle, force, severity)
        stamp = self.start_ns + self._block * BLOCK_NS
        return VibrationBlock.pack(stamp, ACCELEROMETER_AXES, self._offsets, samples)

    def _severity(self, sizes: list[Sizes]) -> Severity:
        """Vibration sources of the block: the faults present in the middle of it."""
        now = {e.row.id: s for e, s in zip(self._episodes, sizes[SCANS // 2]) if s is not None}
        return Severity(
            spall=now.get("spall", 0.0),
            jam=now.get("jam", 0.0),
            friction=now.get("ball_nut_friction", 0.0),
            eccentricity=now.get("rotor_eccentricity", 0.0),
            backlash_m=now.get("backlash", 0.0),
            accelerometers=(now.get("accelerometer_1_fault"), now.get("accelerometer_2_fault")),
        )

    # -- records besides the data ----------------------------------------------------------

    def _opening(self) -> list[Record]:
        sensors = self.scenario.sensors
        rate = sensors.vibration_rate_hz if sensors.vibration else None
        rows = channel_infos(sensors.voltage, rate)
        return [ChannelTable(self.start_ns, "flea_sim", rows)]

    def _truths(self, begin: float) -> list[Record]:
        """What is wrong now: at the start, at each onset, and when all is cleared."""
        told: list[Record] = []
        if self._block == 0 or -1 in self._told:
            self._told.discard(-1)
            stamp = self.start_ns + self._block * BLOCK_NS
            told.append(Truth(stamp, NOMINAL, NEVER_NS, self._details()))
        for number, episode in enumerate(self._episodes):
            if number not in self._told and episode.onset_s < begin + BLOCK_S - 1e-6:
                self._told.add(number)
                told.append(self._truth(episode))
        return told

    def _details(self) -> tuple[tuple[str, str], ...]:
        run = self.scenario.run
        return (("scenario", run.name), ("seed", str(run.seed)))

    def _truth(self, episode: Episode) -> Truth:
        onset = self.start_ns + round(episode.onset_s * 1e9)
        setting = episode.setting
        details = self._details() + (
            ("size", repr(setting.size)), ("size_unit", episode.row.size_unit),
            ("where", setting.where), ("growth_s", repr(setting.growth_s)),
            ("on_s", repr(setting.on_s)), ("off_s", repr(setting.off_s)),
            ("approach", episode.row.approach),
        )  # fmt: skip
        return Truth(onset, setting.fault, onset, details)


def _mean(signals: Array) -> Array:
    """Signals averaged over each scan, shape (SCANS, signals)."""
    return np.asarray(signals.reshape(SCANS, STEPS // SCANS, -1).mean(axis=1))


def with_seed(scenario: Scenario, seed: int) -> Scenario:
    """The same scenario on another draw of units and noise."""
    return replace(scenario, run=replace(scenario.run, seed=seed))
