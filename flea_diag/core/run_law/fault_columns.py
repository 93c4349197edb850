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

"""Effects of the catalogue as columns, one for each size of each fault."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.core.likelihood.fault_models import FaultModel
from flea_diag.core.run_law.run_windows import WINDOW_S, RunWindows

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class FaultColumn:
    """One size of one fault, and its bounds."""

    fault: str
    size: str
    unit: str
    low: float
    high: float

    @property
    def name(self) -> str:
        """The fault, and its size where that is not the word of the fault itself."""
        said = self.size.split()[0]
        return self.fault if self.fault.endswith(said) else f"{self.fault}, {self.size}"

    @property
    def signs(self) -> tuple[float, ...]:
        """Directions that the size may have."""
        return tuple(s for s, bound in ((1.0, self.high), (-1.0, -self.low)) if bound > 0.0)

    def reach(self, sign: float) -> float:
        """Largest magnitude in a direction."""
        return self.high if sign > 0.0 else -self.low


@dataclass(frozen=True, eq=False)
class FaultColumns:
    """Columns of these relations; ``design`` has shape (relations, signals, columns).

    A fault that moves no relation is not among them. ``starting`` are relations that start from a
    reading, and with the error that is in it by then.
    """

    columns: tuple[FaultColumn, ...]
    design: Array
    elapsed: int
    starting: tuple[int, ...] = ()

    def __len__(self) -> int:
        return len(self.columns)

    def of(self, run: RunWindows, onset: int = 0) -> Array:
        """What one unit of each adds from a window on, shape (windows, relations, columns)."""
        added = np.einsum("trs,rsc->trc", run.signals, self.design)
        since_s = (np.arange(len(run)) - onset + 0.5) * WINDOW_S
        added += np.maximum(since_s, 0.0)[:, None, None] * self.design[:, self.elapsed]
        added[:onset] = 0.0
        if not onset:
            added[:, self.starting] -= added[:1, self.starting]
        return np.asarray(added)


def fault_columns(
    models: Iterable[FaultModel], relations: tuple[str, ...], names: tuple[str, ...],
    predictions: Collection[str] = (),
) -> FaultColumns:  # fmt: skip
    """Columns of all models; of a drift that of the youngest age, none of rough variants.

    ``names`` are the signals of windows, ``predictions`` relations that start from a reading.
    """
    found: dict[tuple[str, str, bytes], tuple[FaultColumn, Array]] = {}
    drifts: set[str] = set()
    for model in models:
        if model.roughness or model.fault in drifts:
            continue
        for index, size in enumerate(model.sizes):
            entry = np.zeros((len(relations), len(names)))
            for term in model.terms:
                if term.index == index and term.residual in relations:
                    place = relations.index(term.residual), names.index(term.regressor)
                    entry[place] += term.gain
            if size.name == "drift":
                drifts.add(model.fault)
            column = FaultColumn(model.fault, size.name, size.unit, size.low, size.high)
            if entry.any():
                found.setdefault((model.fault, size.name, entry.tobytes()), (column, entry))
    entries = list(found.values())
    blank = np.zeros((len(relations), len(names), 0))
    design = np.stack([entry for _, entry in entries], axis=-1) if entries else blank
    starting = tuple(k for k, name in enumerate(relations) if name in predictions)
    return FaultColumns(tuple(c for c, _ in entries), design, names.index("elapsed_s"), starting)
