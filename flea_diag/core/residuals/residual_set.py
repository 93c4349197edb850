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

"""Which residuals a description allows: its relations, predictions, sensors and state observer.

The order is that of what they tell: balances that hold the friction, other balances, what is held
against a command, what two sensors read of one quantity; then predictions, tests of single
sensors, innovations. Within each it is that of the description.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from math import nan

from flea_diag.core.bond_graph.actuator_model import Actuator, ResidualSpec, Sensor
from flea_diag.core.bond_graph.bond_graph import SOURCES
from flea_diag.core.bond_graph.modes import MachineMode
from flea_diag.core.machine_modes import HELD, ModeRow
from flea_diag.core.residuals.channel_units import UNITS
from flea_diag.core.residuals.driven_equations import DrivenChannels, driven_equations
from flea_diag.core.residuals.measured_graph import MECHANICAL, channel_of
from flea_diag.core.residuals.relation_set import DIRECTION, CompiledRelation, RelationSet
from flea_diag.core.residuals.residual_rows import SPEED, Parity, ResidualRow, ResidualSet
from flea_diag.core.residuals.stop import reactions_at
from flea_diag.core.sensors.sensor_set import SensorSet
from flea_diag.core.symbolic.expression import ZERO, substitute, symbols
from flea_diag.errors import ModelError

DRIVEN = "driven"
"""Model whose inputs are measured: that of the state observer."""
COMPILED = ("junction", "power", "difference")
"""Kinds of residuals that are parity relations."""


def residual_set(actuator: Actuator, known: RelationSet) -> ResidualSet:
    """Residuals of a description whose sensors close the relations ``known``."""
    encoder = encoder_of(actuator)
    positions = tuple(s.channel for s in actuator.sensors.values() if s.integrates)
    motion = {*positions, encoder}
    rows = [actuator.residuals[name] for name in known.names]
    parities = tuple(_parities(actuator, known, motion))
    units = _units(actuator, known)
    predictions = {row.name: row.channel for row in known.predictions}
    twins = tuple(r.name for r in rows if {r.channel, r.reference} <= motion - {""})
    friction = next((row.name for row in known.relations if DIRECTION in row.signals), "")
    circuit = next((row.name for row in rows if _is_circuit(actuator, row)), "")
    voltage, current = _motor_voltage(actuator), _reads(actuator, "1", ("electrical",))
    command = _command(actuator, rows, voltage)
    sensors = _sensors(actuator, units, encoder, voltage, command)
    made = ResidualSet(
        units,
        parities,
        predictions,
        tuple(_sensor_rows(sensors)),
        sensors=sensors,
        positions=positions,
        encoder=encoder,
        voltage=voltage,
        current=current,
        load=_reads(actuator, "0", MECHANICAL),
        command=command,
        noise={sensor.channel: sensor.noise for sensor in actuator.sensors.values()},
        friction=friction,
        circuit=circuit,
        zeros=_zeros(known, {friction: "current_offset_a", circuit: "voltage_offset_v"}),
        twins=twins,
        stretched=tuple(name for name in twins if actuator.residuals[name].across),
        of_one_speed=tuple(n for n in twins if actuator.residuals[n].channel == encoder),
        own=dict(_own(actuator, [*(row.name for row in parities), *predictions])),
        smoothing_s=actuator.smoothing_s,
    )
    made = _observed(actuator, known, made)
    modes = tuple(_mode(actuator, known, made, mode) for mode in actuator.modes.values())
    told = [(made.channels[m.channel], j) for m in modes for j in (*m.voids, *m.only)]
    if not made.load and not any(mode.stands for mode in modes) and _carries(known, made):
        voids = tuple(made.of_relation(friction))
        modes += (ModeRow(HELD, -1, nan, nan, 0.0, voids, (), stands=True, followed=False),)
    parities = tuple(
        replace(row, needs=tuple(dict.fromkeys((*row.needs, *(c for c, k in told if k == j)))))
        for j, row in enumerate(made.parities)
    )
    bands = tuple(s for s in actuator.supplies.values() if s.residual in known.names)
    return replace(made, modes=modes, parities=parities, bands=bands)


def _mode(actuator: Actuator, known: RelationSet, rows: ResidualSet, mode: MachineMode) -> ModeRow:
    """A mode with the columns that it voids: those named, and balances of the part it holds."""
    held = reactions_at(actuator, mode.holds, known.names) if mode.holds else {}
    void, only = (
        [rows.relation(name) for name in names] for names in ((*held, *mode.voids), mode.only)
    )
    balances = [name for name in void if actuator.residuals[name].balances]
    return ModeRow(
        mode.name,
        rows.index[mode.channel],
        mode.above,
        mode.below,
        mode.settles_s,
        tuple(_values(rows, void)),
        tuple(_values(rows, only)),
        bool(mode.holds),
        not balances,
    )


def _carries(known: RelationSet, rows: ResidualSet) -> bool:
    """Whether something moves the machine at rest without a current, such as a weight."""
    zero = known.offsets.get(rows.current, ZERO)
    rates = {signal: ZERO for signal in known.signals if channel_of(signal)[1]}
    return bool(rows.current) and substitute(known.push, {**rates, rows.current: zero}) != ZERO


def _values(rows: ResidualSet, names: Sequence[str]) -> list[int]:
    """Columns of relations, normalised or not, and of predictions."""
    return [j for j, row in enumerate(rows.rows) if rows.relation(row.name) in names]


def relation_names(actuator: Actuator) -> tuple[str, ...]:
    """Residuals whose relations are to be compiled, normalised ones by what they normalise."""
    specs = actuator.residuals.values()
    found = (relation_of(actuator, s) for s in specs if s.kind in COMPILED)
    return tuple(dict.fromkeys(n for n in found if not _drives_elsewhere(actuator, n)))


def relation_of(actuator: Actuator, spec: ResidualSpec) -> str:
    """The residual that this one is the direction-normalised form of, or itself."""
    if not spec.normalised:
        return spec.name
    plain = (row for row in actuator.residuals.values() if not row.normalised)
    return next((row.name for row in plain if _bare(row) == _bare(spec)), spec.name)


def encoder_of(actuator: Actuator) -> str:
    """The sensor that reads a speed itself; empty: none."""
    return _reads(actuator, "1", MECHANICAL)


def _reads(actuator: Actuator, kind: str, domains: tuple[str, ...]) -> str:
    """The first sensor of an effort (at "0") or a flow (at "1") itself; empty: none."""
    for sensor in actuator.sensors.values():
        if sensor.at and not sensor.integrates:
            place = actuator.graph.elements[sensor.at]
            if place.kind == kind and place.domain in domains:
                return sensor.channel
    return ""


def _motor_voltage(actuator: Actuator) -> str:
    """The first sensor of the voltage at a motor; that of a link or a battery is none."""
    graph = actuator.graph
    motors = {bond.other(e.name) for e in graph.of_kind("GY") for bond in graph.at(e.name)}
    beside = {bond.other(name) for name in motors for bond in graph.at(name)}
    at_motor = {
        name: sensor
        for name, sensor in actuator.sensors.items()
        if not motors or sensor.at in motors | beside
    }
    return _reads(replace(actuator, sensors=at_motor), "0", ("electrical",))


def _command(actuator: Actuator, rows: list[ResidualSpec], voltage: str) -> str:
    """The input that a difference holds the voltage against; empty: none."""
    held = (row.reference for row in rows if row.kind == "difference" and row.channel == voltage)
    return next((name for name in held if name in actuator.inputs), "")


def _bare(spec: ResidualSpec) -> ResidualSpec:
    return replace(spec, name="", normalised=False, motion="", signs=True)


def _drives_elsewhere(actuator: Actuator, name: str) -> bool:
    """Whether a difference is held against the command of a source at another junction.

    What lies between then takes its part of that effort or flow, unless the difference names it
    (``across``): the two are alike at a standstill.
    """
    spec, graph = actuator.residuals[name], actuator.graph
    sensor = actuator.sensors.get(spec.channel)
    sources = [e for e in graph.of_kind(*SOURCES) if spec.reference and e.signal == spec.reference]
    fed = {bond.other(e.name) for e in sources for bond in graph.at(e.name)}
    elsewhere = bool(fed) and (sensor is None or sensor.at not in fed)
    return spec.kind == "difference" and elsewhere and not spec.across


def _zeros(known: RelationSet, wanted: Mapping[str, str]) -> Mapping[str, str]:
    held = {row.name: symbols(row.expression) for row in known.relations}
    return {row: zero for row, zero in wanted.items() if row and zero in held[row]}


def _is_circuit(actuator: Actuator, spec: ResidualSpec) -> bool:
    place = actuator.graph.elements.get(spec.junction)
    return spec.kind == "junction" and place is not None and place.domain == "electrical"


def _parities(actuator: Actuator, known: RelationSet, motion: set[str]) -> Iterator[Parity]:
    specs = [row for row in actuator.residuals.values() if row.kind in COMPILED]
    for relation in known.relations:
        needs = _needs(actuator, known, relation, motion)
        own = [s for s in specs if relation_of(actuator, s) == relation.name]
        for spec in sorted(own, key=lambda s: s.normalised):
            yield Parity(
                spec.name,
                spec.unit,
                needs,
                # At rest friction takes whatever force there is, but no power.
                spec.normalised or (DIRECTION in relation.signals and spec.kind != "power"),
                spec.normalised,
                relation.name,
                relation.name in known.differing,
                spec.signs or spec.kind == "difference",
                spec.settles_s,
            )


def _needs(
    actuator: Actuator, known: RelationSet, row: CompiledRelation, motion: set[str]
) -> tuple[str, ...]:
    """Channels that a relation reads; a balance takes the speed from wherever it is known."""
    inside = [n for s in row.signals if s in known.shapes for n in symbols(known.shapes[s])]
    read = [channel_of(name) for name in (*row.signals, *inside)]
    displaced = set(known.displacements)
    needs = dict.fromkeys(
        SPEED
        if row.kind != "difference" and name in motion and (order or name not in displaced)
        else name
        for name, order in read
        if name in actuator.units
    )
    return tuple(needs)


def _units(actuator: Actuator, known: RelationSet) -> Mapping[str, str]:
    """Unit of every sensor, and of every input that a relation reads; standard channels first."""
    read = {channel_of(signal)[0] for signal in known.signals} | set(known.neighbours)
    read |= {mode.channel for mode in actuator.modes.values()}
    names = [n for n in actuator.units if n in actuator.sensors or n in read]
    standard = [name for name in UNITS if name in names]
    return {name: actuator.units[name] for name in dict.fromkeys((*standard, *names))}


def _sensors(
    actuator: Actuator, units: Mapping[str, str], encoder: str, voltage: str, command: str
) -> SensorSet:
    """Those that are tested by themselves; voltages for held readings alone.

    Steps are tested of positions that plant faults move through the motion alone: not of one whose
    column in the signature tables is that of the stand with its control loops.
    """
    sensors = {name: actuator.sensors[name] for name in units if name in actuator.sensors}
    noises = {n: s.noise for n, s in sensors.items() if not _is_voltage(actuator, s)}
    specs = actuator.residuals.values()
    looped = {s.channel for s in specs if s.kind == "measurement" and s.model != DRIVEN}
    positions = {n: s.unit for n, s in sensors.items() if s.integrates and n not in looped}
    held = {voltage: command} if voltage else {}
    return SensorSet.of(noises, positions, encoder, held, actuator.scan_period_s)


def _is_voltage(actuator: Actuator, sensor: Sensor) -> bool:
    place = actuator.graph.elements.get(sensor.at)
    return place is not None and (place.kind, place.domain) == ("0", "electrical")


def _sensor_rows(sensors: SensorSet) -> Iterator[ResidualRow]:
    for name in sensors.names:
        yield ResidualRow(name, "1", (sensors.channel_of(name),), "sensor", (1,))


def _observed(actuator: Actuator, known: RelationSet, rows: ResidualSet) -> ResidualSet:
    """The same with what the state observer predicts, and the innovations that are tested.

    Not those of a channel that the model moves to another junction: its prediction rests on a rigid
    coupling.
    """
    view = actuator.views.get(DRIVEN)
    specs = [s for s in actuator.residuals.values() if s.kind == "measurement"]
    named = [s.channel for s in specs if s.model == DRIVEN]
    reads = (rows.current, rows.voltage, rows.encoder, *rows.positions)
    rows = replace(rows, observed=tuple(name for name in reads if name))
    if view is None or not set(view.measured) <= set(actuator.sensors):
        return replace(rows, observed=())
    try:
        given = driven_equations(known, rows).readings
    except ModelError:
        return replace(rows, observed=())
    observed = tuple(name for name in rows.observed if name in given)
    tested = (n for n in named if n in observed and n not in (*view.moved, *view.measured))
    innovated = tuple(tested)
    pairs = (row for name in innovated for row in _innovation_rows(name, rows.voltage))
    heated = DrivenChannels.of(known, rows).heated
    return replace(
        rows,
        observed=observed,
        heated=heated,
        innovated=innovated,
        innovation_rows=tuple(pairs),
    )


def _innovation_rows(channel: str, voltage: str) -> tuple[ResidualRow, ResidualRow]:
    needs = (channel, voltage, SPEED)
    raw = ResidualRow(f"innovation_{channel}", "1", needs, "moving", isolates=False)
    return raw, replace(raw, name=f"{raw.name}_dn")


def _own(actuator: Actuator, names: list[str]) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Residuals in no signature table: sensors alone move a difference of two, or an input."""
    for name in names:
        spec = actuator.residuals[name]
        if not spec.signs and not spec.balances:
            yield name, tuple(c for c in (spec.channel, spec.reference) if c)
