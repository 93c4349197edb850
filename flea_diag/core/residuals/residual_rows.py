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

"""The residuals of one stand, a row each: their order, and what all else looks up about one.

What a stand has follows from its description (``residual_set``); their values are the columns of
``residual_values``.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt

from flea_diag.core.bond_graph.supplies import Supply
from flea_diag.core.faults.sensor_symptoms import SensorSymptoms
from flea_diag.core.frozen import Frozen
from flea_diag.core.machine_modes import ModeRow
from flea_diag.core.residuals.channel_units import CURRENT, ENCODER, LOAD, POSITION
from flea_diag.core.scan_counts import SMOOTHING_S
from flea_diag.core.sensors.sensor_set import SensorSet
from flea_diag.core.sensors.unit_change import TOGETHER

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

SPEED = "speed"
"""Stands for the channel the speed comes from: the encoder, or the slope of the position."""
WINDOWS_S = (0.5, 1.0, 4.0)
"""Times over which a residual is averaged before a test, but for tests of single sensors."""


@dataclass(frozen=True, slots=True)
class ResidualRow(Frozen):
    """One residual: its unit, the channels it needs, and when it may be tested.

    ``gate`` is "moving" where the excitation of motion is needed, "always" where not, and
    "sensor" where ``sensor_tests`` judge it. ``windows_s`` are the times over which it is
    averaged before a test, not counting those without one. A row with ``isolates`` False detects,
    but makes no symbol.
    """

    name: str
    unit: str
    needs: tuple[str, ...]
    gate: str
    windows_s: tuple[float, ...] = WINDOWS_S
    isolates: bool = True


@dataclass(frozen=True, slots=True)
class Parity(Frozen):
    """One residual that is the value of a parity relation.

    ``needs`` names the channels without which there is no residual, ``relation`` the relation that
    it is the value of; ``gated`` says whether it needs motion, ``differs`` whether healthy units
    differ in it, ``isolates`` whether it makes symbols, and ``settles_s`` for how long after a
    start, a stop or a reversal it has no value.
    """

    name: str
    unit: str
    needs: tuple[str, ...]
    gated: bool
    normalised: bool
    relation: str
    differs: bool
    isolates: bool = True
    settles_s: float = 0.0

    @property
    def row(self) -> ResidualRow:
        """The same as a residual."""
        gate = "moving" if self.gated else "always"
        return ResidualRow(self.name, self.unit, self.needs, gate, isolates=self.isolates)


@dataclass(frozen=True, slots=True)
class ReadingTerm(Frozen):
    """A channel that a residual reads as it is: its column among the signals, and its zero.

    ``units`` are the places of the unit parameters that the residual depends on. ``warmed`` are
    those that follow a store which is predicted: the place among ``units``, and that store's in
    ``Heating``. ``beside`` are those that are next to such a store, as a magnet is to its winding:
    the place, and the signal that is its temperature.
    """

    residual: str
    channel: str
    signal: int
    zero: float
    units: tuple[int, ...] = ()
    warmed: tuple[tuple[int, int], ...] = ()
    beside: tuple[tuple[int, int], ...] = ()


@dataclass(frozen=True, eq=False)
class ResidualSet(Frozen):
    """All residuals of one stand, in their order, and the channels that they read.

    Attributes
    ----------
    units
        Channel -> unit, in the order of the columns of a row of readings.
    parities
        Residuals by parity relations.
    predictions
        Residuals by prediction of a slow store, such as a temperature -> the channel predicted.
    sensor_rows
        Tests of single sensors, in the order in which ``sensor_tests`` fills them.
    innovation_rows
        Pairs of one channel predicted by the state observer, raw and direction-normalised; empty
        where the description allows no state observer.
    innovated
        These channels.
    positions
        Channels that read a displacement.
    encoder
        Channel of the shaft's speed; empty: none.
    voltage, current
        Channels of effort and flow of the motor circuit; empty: none.
    load
        Channel of the force or torque on the load side; empty: none.
    command
        Input that the voltage is held against; empty: none.
    observed
        Channels of the motion that the state observer predicts: circuit, encoder, positions.
    heated
        Channels of the stores that it follows besides.
    noise
        Channel -> standard deviation of one reading, by the description.
    sensors
        Those that are tested by themselves.
    friction
        Relation that holds the friction, and with it the direction of motion; empty: none.
    circuit
        Balance of the motor circuit; empty: none.
    zeros
        Relation -> the offset of a unit's sensor that it fixes at the start of a stream.
    twins
        Differences between two sensors of one motion.
    stretched
        Those of them that hold what lies between the two places (``across``).
    of_one_speed
        Those of them between two speeds: sensors agree better than any interpolation of lost scans.
    own
        Residual that is in no signature table -> sensors whose faults alone move it.
    smoothing_s
        Time over which readings are smoothed.
    modes
        Modes of the machine that a channel tells.
    bands
        Supplies whose level a relation of these holds.
    """

    units: Mapping[str, str]
    parities: tuple[Parity, ...]
    predictions: Mapping[str, str] = field(default_factory=dict)
    sensor_rows: tuple[ResidualRow, ...] = ()
    innovation_rows: tuple[ResidualRow, ...] = ()
    innovated: tuple[str, ...] = ()
    positions: tuple[str, ...] = ()
    encoder: str = ""
    voltage: str = ""
    current: str = ""
    load: str = ""
    command: str = ""
    observed: tuple[str, ...] = ()
    heated: tuple[str, ...] = ()
    noise: Mapping[str, float] = field(default_factory=dict)
    sensors: SensorSet = field(default_factory=lambda: SensorSet({}, {}))
    friction: str = ""
    circuit: str = ""
    zeros: Mapping[str, str] = field(default_factory=dict)
    twins: tuple[str, ...] = ()
    stretched: tuple[str, ...] = ()
    of_one_speed: tuple[str, ...] = ()
    own: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    smoothing_s: float = SMOOTHING_S
    modes: tuple[ModeRow, ...] = ()
    bands: tuple[Supply, ...] = ()

    @cached_property
    def channels(self) -> tuple[str, ...]:
        """Channels that the diagnosis reads, in the order of the columns of every row."""
        return tuple(self.units)

    @cached_property
    def index(self) -> Mapping[str, int]:
        """Column of each channel."""
        return {name: column for column, name in enumerate(self.channels)}

    @cached_property
    def motion(self) -> tuple[str, ...]:
        """Channels of the motion: positions and encoder."""
        return (*self.positions, *((self.encoder,) if self.encoder else ()))

    @cached_property
    def symptoms(self) -> SensorSymptoms:
        """What isolation looks up about sensors."""
        tested = {row.name for row in self.sensor_rows}
        stepping = tuple(name for name in self.positions if name in tested)
        return SensorSymptoms(stepping, self.motion, self.twins, self.stretched, self.own)

    @property
    def followed(self) -> tuple[str, str, str, str]:
        """Channels of current, load, speed and position, standard ones where the stand has none."""
        return (
            self.current or CURRENT,
            self.load or LOAD,
            self.encoder or ENCODER,
            self.position or POSITION,
        )

    @property
    def predicted(self) -> tuple[str, ...]:
        """Channels that the state observer predicts, in the order of its innovations."""
        return self.observed + self.heated

    @property
    def position(self) -> str:
        """Channel whose slope is the speed without an encoder; empty: none."""
        return next(iter(self.positions), "")

    @cached_property
    def rows(self) -> tuple[ResidualRow, ...]:
        """All residuals."""
        thermal = (ResidualRow(n, "K", (c,), "always") for n, c in self.predictions.items())
        parities = (row.row for row in self.parities)
        return (*parities, *thermal, *self.sensor_rows, *self.innovation_rows)

    @cached_property
    def place(self) -> Mapping[str, int]:
        """Column of each residual."""
        return {row.name: column for column, row in enumerate(self.rows)}

    @cached_property
    def named(self) -> Mapping[str, ResidualRow]:
        """Residuals by name."""
        return {row.name: row for row in self.rows}

    @cached_property
    def relations(self) -> tuple[str, ...]:
        """Parity relations, in their order."""
        return tuple(dict.fromkeys(row.relation for row in self.parities))

    @cached_property
    def weighed(self) -> tuple[str, ...]:
        """Residuals that quantitative fault models explain: relations and predictions."""
        return (*self.relations, *self.predictions)

    @cached_property
    def in_motion(self) -> frozenset[str]:
        """Residuals that mean something in motion alone."""
        return frozenset(row.name for row in self.rows if row.gate == "moving")

    @cached_property
    def _relation(self) -> Mapping[str, str]:
        return {row.name: row.relation for row in self.parities}

    def relation(self, residual: str) -> str:
        """The relation of a residual, normalised or not; any other is its own."""
        return self._relation.get(residual, residual)

    @cached_property
    def required(self) -> tuple[str, ...]:
        """Channels without which nothing can be diagnosed: those of the relation with friction."""
        needs = self.named[self.friction].needs if self.friction else ()
        speed = (self.position,) if SPEED in needs and self.position else ()
        return (*(name for name in needs if name != SPEED), *speed)

    @cached_property
    def spreading(self) -> tuple[int, ...]:
        """Columns in which healthy units differ, in the order of ``ResidualRows.spread``."""
        return tuple(self.place[row.name] for row in self.parities if row.differs)

    @cached_property
    def sensor_columns(self) -> slice:
        """Columns of the tests of single sensors."""
        start = len(self.parities) + len(self.predictions)
        return slice(start, start + len(self.sensor_rows))

    @cached_property
    def innovation_columns(self) -> slice:
        """Columns of the innovations."""
        return slice(self.sensor_columns.stop, len(self.rows))

    @cached_property
    def innovations(self) -> tuple[str, ...]:
        """Names of the innovations."""
        return tuple(row.name for row in self.innovation_rows)

    @cached_property
    def of_unit(self) -> list[str]:
        """Residuals by prediction that are of the unit, and not of what it stands in."""
        return [name for name in self.predictions if name not in self.own]

    @cached_property
    def lone_temperature(self) -> list[str]:
        """The temperature of the unit if it has one thermocouple: none steps with it."""
        return self.of_unit if len(self.of_unit) < TOGETHER else []

    @cached_property
    def predicted_columns(self) -> list[int]:
        """Columns of residuals by prediction."""
        return [self.place[name] for name in self.predictions]

    @cached_property
    def isolating(self) -> Flags:
        """Which residuals make symbols, shape (residuals,)."""
        return np.array([row.isolates for row in self.rows], dtype=bool)

    def column(self, residual: str) -> int:
        """Column of a residual; -1 where the stand lacks it."""
        return self.place.get(residual, -1)

    def channel(self, name: str) -> int:
        """Column of a channel; -1 where the stand lacks it."""
        return self.index.get(name, -1)

    def of_relation(self, relation: str) -> list[int]:
        """Columns of the values of one relation, normalised or not."""
        return self.of_relations((relation,))

    def of_relations(self, relations: Collection[str]) -> list[int]:
        """Columns of the values of these relations."""
        return [self.place[row.name] for row in self.parities if row.relation in relations]

    def needing(self, *channels: str) -> list[int]:
        """Columns of the residuals that need all of these channels."""
        return [j for j, row in enumerate(self.rows) if set(channels) <= set(row.needs)]

    def columns(self, names: Iterable[str]) -> list[int]:
        """Columns of these residuals."""
        return [self.place[name] for name in names]
