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

"""Columns of nominal recordings, smoothed with the kernel of the diagnoser."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field

import numpy as np
import numpy.typing as npt

from flea_diag.core.calibration.calibration import NominalRun
from flea_diag.core.machine_modes import MachineModes
from flea_diag.core.residuals.measured_graph import channel_of
from flea_diag.core.residuals.parameters import ActuatorParameters
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.core.residuals.residual_rows import ResidualSet
from flea_diag.core.smoothing import bridge, hann_kernels
from flea_diag.core.symbolic.expression import evaluate
from flea_diag.errors import CalibrationError

Array = npt.NDArray[np.float64]
Numbers = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Smoothed:
    """Smoothed columns of all runs, concatenated; ``run`` is the recording of each row.

    ``rows`` says which column is which channel.
    """

    rows: ResidualSet
    value: Array
    first: Array
    second: Array
    run: Numbers
    kernel: int
    """Scans that one smoothed value rests on."""
    fold: Numbers = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    """Of each recording, the number of the group that is left out together with it."""
    void: Mapping[str, Flags] = field(default_factory=dict)
    """Relation -> rows in which it does not hold, for a mode of the machine; those of any other
    relation are not there."""

    def column(self, channel: str) -> Array:
        """Smoothed values of one channel."""
        return self.of_order(0, channel)

    def of_order(self, order: int, channel: str) -> Array:
        """Smoothed derivative of one channel; NaN where the stand lacks it."""
        column = self.rows.channel(channel)
        table = (self.value, self.first, self.second)[order]
        return table[:, column] if column >= 0 else np.full(len(table), np.nan)

    def with_values(self, *channels: str) -> Flags:
        """Rows in which all of these channels have a value."""
        finite = np.isfinite([self.column(channel) for channel in channels])
        return np.asarray(finite.all(axis=0), dtype=np.bool_)

    def speed(self, parameters: ActuatorParameters) -> Array:
        """Speed of the load, from the encoder where its lead is known."""
        lead = parameters.encoder_m_per_rad
        if lead:
            return np.asarray(lead * self.column(self.rows.encoder))
        return self.of_order(1, self.rows.position)

    def signals(self, relations: RelationSet, parameters: ActuatorParameters) -> dict[str, Array]:
        """Columns of the signals of the relations, shapes with the parameters as assumed."""
        found: dict[str, Array] = {}
        for name in relations.signals:
            channel, order = channel_of(name)
            if name in relations.predicted:
                # On nominal recordings the reading is the prediction; without one it is the
                # reference.
                warm = self.column(relations.predicted[name])
                found[name] = np.where(np.isnan(warm), relations.reference[name], warm)
            elif name not in relations.shapes:
                found[name] = self.of_order(order, channel)
        for name, shape in relations.shapes.items():
            found[name] = np.asarray(evaluate(shape, {**asdict(parameters), **found}))
        return found


def smooth(
    runs: Sequence[NominalRun], rows: ResidualSet, kernel_length: int, period_s: float
) -> Smoothed:
    """All runs, smoothed with the kernel of the diagnoser."""
    kernels = hann_kernels(kernel_length, period_s)
    parts: list[list[Array]] = [[], [], []]
    numbers, voids = [], []
    for number, run in enumerate(runs):
        if len(run.rows) < kernel_length:
            continue
        windows = np.lib.stride_tricks.sliding_window_view(run.rows, kernel_length, axis=0)
        whole = np.stack([windows @ kernel for kernel in kernels], axis=1)
        bridge(run.rows, whole, period_s)
        for part, smoothed in zip(parts, whole.transpose(1, 0, 2), strict=True):
            part.append(smoothed)
        numbers.append(np.full(len(windows), number))
        voids.append(_void(run, rows, kernel_length, period_s))
    if not numbers:
        raise CalibrationError("no recording is as long as the smoothing window")
    value, first, second = (np.concatenate(part) for part in parts)
    run_of = np.concatenate(numbers)
    void = {name: np.concatenate([each[name] for each in voids]) for name in voids[0]}
    return Smoothed(rows, value, first, second, run_of, kernel_length, void=void)


def _void(
    run: NominalRun, rows: ResidualSet, kernel_length: int, period_s: float
) -> dict[str, Flags]:
    """Relation -> smoothed rows of a recording in which it does not hold, for a mode."""
    modes = MachineModes(rows.modes, period_s, kernel_length)
    told = {rows.relation(rows.rows[j].name) for m in rows.modes for j in (*m.voids, *m.only)}
    found = {name: np.zeros(len(run.rows), dtype=bool) for name in told}
    for columns, flags in modes.step(run.rows)[1]:
        for name in {rows.relation(rows.rows[j].name) for j in columns}:
            found[name] |= flags
    return {name: flags[kernel_length - 1 :] for name, flags in found.items()}
