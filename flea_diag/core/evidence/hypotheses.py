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

"""What a stream may differ by, and what faults add to it, as columns for one window.

Under no fault y = Psi (mean + root eta) + e, eta ~ N(0, 1): what this recording differs by, and
how well the law knows its own means. Another unit adds Psi_unit u, a fault Phi theta, each from
its onset on.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from flea_diag.core.evidence.fault_signatures import FaultSignatures, SizePrior
from flea_diag.core.evidence.friction import Friction
from flea_diag.core.evidence.marginal_ratio import Sums, marginal_ratio
from flea_diag.core.evidence.stream_windows import LawWindow
from flea_diag.core.evidence.turned_way import TurnedWay
from flea_diag.core.frozen import Frozen
from flea_diag.core.likelihood.basis import Basis
from flea_diag.core.likelihood.fault_models import FaultModel
from flea_diag.core.run_law.law_columns import FREE, NEGLECTED, LawColumns
from flea_diag.core.run_law.law_noise import BOUND, LawNoise
from flea_diag.core.run_law.run_law import RunLaw
from flea_diag.core.run_law.run_windows import WINDOW_S
from flea_diag.core.run_law.visible_sizes import WIDE

Array = npt.NDArray[np.float64]

OTHER_UNIT_K = 5.0
"""How much warmer or colder a part of another unit may be."""


@dataclass(frozen=True, eq=False)
class StreamHypotheses(Frozen):
    """Of one stand, in the noise of its law.

    Attributes
    ----------
    mean
        Of the columns, shape (columns,).
    root
        What this recording differs by for each of eta, shape (columns, columns).
    unit
        Columns that another unit has anew, and by how much, shape (columns, differences).
    room
        Which of these are of the room that it stands in, shape (differences,).
    room_models
        Models that enter a relation of the room, as an error of its thermometer does, (models,).
    feigned
        Sizes that whole healthy recordings feign, and what begins within them.
    memory_s
        Time in which what is known of a stream fades to 1/e.
    friction
        What it does beyond the noise of the law.
    way
        The way of the current, which an error of its reading may turn; None: nothing goes by it.
    """

    signatures: FaultSignatures
    columns: LawColumns
    noise: LawNoise
    mean: Array
    root: Array
    unit: Array
    room: npt.NDArray[np.bool_]
    room_models: npt.NDArray[np.bool_]
    feigned: tuple[SizePrior, SizePrior]
    memory_s: float
    friction: Friction
    way: TurnedWay | None = None

    @classmethod
    def of(
        cls, law: RunLaw, columns: LawColumns, signatures: FaultSignatures, friction: Friction,
        another: bool = False, rooms: Collection[str] = (), recording_s: float = math.inf,
        way: TurnedWay | None = None,
    ) -> StreamHypotheses:  # fmt: skip
        """By a law; ``another``: of a unit that it was not learned from.

        Parameters
        ----------
        rooms
            Relations that hold nothing of a unit.
        recording_s
            How long the recordings of the law are: that anything stays what it is for longer,
            they do not say.
        """
        spread = law.spread(another)
        variance = unit_variance(law, columns)
        total = np.diag(spread.variance + (variance if another else 0.0)) + spread.covariance
        total += np.diag(np.maximum(session_variance(columns) - np.diag(total), 0.0))
        values, vectors = np.linalg.eigh(total)
        acts = np.flatnonzero(variance > 0.0)
        unit = np.zeros((len(variance), len(acts)))
        unit[acts, np.arange(len(acts))] = np.sqrt(variance[acts])
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        of_room = np.array([name in rooms for name in columns.relations])
        room = ~(columns.design[~of_room] != 0.0).any(axis=(0, 1))
        entered = (signatures.design[of_room] != 0.0).any(axis=(0, 1))
        return cls(
            signatures, columns, law.law_noise, spread.mean, root, unit, room[acts],
            entered.reshape(signatures.shape).any(axis=1), _feigned(law, signatures),
            min(law.time_constant_s, recording_s), friction, way,
        )  # fmt: skip

    def evidence(self, sums: Sums) -> Array:
        """Log evidence of every model over nothing, nats, shape (..., models)."""
        return marginal_ratio(sums, self.signatures.prior, reaching=True)

    def of_healthy(self, sums: Sums, from_before: npt.ArrayLike) -> Array:
        """The same of sizes that healthy recordings feign, at least that of nothing.

        ``from_before``, shape (...): the onset is the start of the stream. What a whole recording
        differs by may look like any fault, as likely as another: there their mean counts, too.
        """
        of_whole, of_onset = self.feigned
        before = np.asarray(from_before)[..., None]
        begun = np.maximum(marginal_ratio(sums, of_onset), 0.0)
        if not before.any():
            return begun
        whole = begun
        if of_whole is not of_onset:
            whole = np.maximum(marginal_ratio(sums, of_whole), 0.0)
        mean = np.logaddexp.reduce(whole, axis=-1, keepdims=True) - math.log(whole.shape[-1])
        return np.where(before, np.maximum(whole, mean), begun)

    def faults(self, window: LawWindow, errors: Array) -> tuple[Array, Array]:
        """What one unit of each size adds, and for each second, shape (..., relations, sizes).

        A signal that a relation answers by carries its noise, so what the relation says takes its
        place; but what of its residual is no noise, a fault has done to the signal.

        Parameters
        ----------
        errors
            Of prediction under no fault, in standard deviations of a window, (..., relations).
        """
        return self.signatures.signals(_answered(window, errors))

    def effect(self, window: LawWindow, errors: Array, model: int, size: Array) -> Array:
        """What one fault of this size adds, shape (..., relations); ``errors`` as in ``faults``."""
        design = self.signatures.design
        each = design.reshape(*design.shape[:2], *self.signatures.shape)[:, :, model] @ size
        return np.asarray(np.einsum("...rs,rs->...r", _answered(window, errors), each))

    def turned(self, window: LawWindow, errors: Array, left: Array, eta: Array) -> Array:
        """What errors of the current add by turning its sign, shape (relations, models * sizes).

        Parameters
        ----------
        errors, left
            Of prediction under no fault, in standard deviations of a window and in the units of the
            relations, shape (relations,).
        eta
            What is known of this recording.
        """
        added = np.zeros((len(errors), self.signatures.design.shape[-1]))
        if self.way is not None:
            law = self._recording @ np.concatenate(([1.0], eta[:-1]))
            turn = self.way.added(window, left, told_share(errors), law)
            added[:, self.signatures.turns] = turn[:, None]
        return added

    def own(self, window: LawWindow, number: npt.ArrayLike) -> tuple[Array, Array]:
        """What is left beside the mean, shape (..., relations), and Psi root.

        ``number`` of the window since the start of the stream: since then its parts heat up. At a
        standstill against a push the friction holds anything up to the dry friction: the last
        column of Psi root, about none of it.
        """
        told = self._acted(window, number, self._recording)
        held = self.friction.held(window)
        psi_root = np.concatenate((told[..., 1:], held[..., None] / math.sqrt(3.0)), axis=-1)
        return window.values + held - told[..., 0], psi_root

    def loudness(self, window: LawWindow) -> Array:
        """Factor of the standard deviation of the noise in a window, shape (..., relations)."""
        loud = self.noise.loudness(window.motion) * self.friction.loudness(window.read)
        return np.asarray(loud)

    def left(self, window: LawWindow, number: npt.ArrayLike) -> Array:
        """What is left beside the mean, as in ``own``."""
        mean = self._acted(window, number, self._recording[..., :1])[..., 0]
        return np.asarray(window.values + self.friction.held(window) - mean)

    def of_unit(self, window: LawWindow, number: npt.ArrayLike) -> Array:
        """Psi_unit."""
        return self._acted(window, number, self._another)

    def _acted(self, window: LawWindow, number: npt.ArrayLike, design: Array) -> Array:
        """What signals and the time since the start do by a design, (..., relations, columns)."""
        signals = window.signals.copy()
        signals[..., self.columns.elapsed] += ((np.asarray(number) + 0.5) * WINDOW_S)[..., None]
        # Relation by relation: the same bits for one window as for many.
        return np.asarray(np.matmul(signals[..., None, :], design)[..., 0, :])

    @cached_property
    def _recording(self) -> Array:
        """Columns of the mean and of ``root``, shape (relations, signals, 1 + columns)."""
        return np.asarray(self.columns.design @ np.column_stack((self.mean, self.root)))

    @cached_property
    def _another(self) -> Array:
        """Columns of ``unit``, shape (relations, signals, differences)."""
        return np.asarray(self.columns.design @ self.unit)

    def acting(self, asked: npt.ArrayLike = True) -> npt.NDArray[np.bool_]:
        """By which signals anything acts in a relation, shape (relations, signals).

        ``asked``, shape (models,) or one for all: the models of faults that count. By what the
        others act, no relation needs.
        """
        models, sizes = self.signatures.shape
        counts = np.repeat(np.broadcast_to(np.asarray(asked, dtype=bool), models), sizes)
        faults, runs = self.signatures.design[..., counts], self.columns.design
        return np.asarray((faults != 0.0).any(axis=-1) | (runs != 0.0).any(axis=-1))

    @property
    def own_count(self) -> int:
        """Columns of what a window says itself: its value, and what the stream may differ by."""
        return 2 + int(self.root.shape[1])


def _answered(window: LawWindow, errors: Array) -> Array:
    """Signals by which faults act, see ``StreamHypotheses.faults``; (..., relations, signals)."""
    share = told_share(errors)[..., None]
    return np.asarray(window.signals + share * (window.read - window.signals))


def told_share(errors: Array) -> Array:
    """How much of errors is no noise, 0 to 1; in standard deviations, shape (..., relations)."""
    return np.asarray(1.0 - BOUND / np.maximum(np.abs(errors), BOUND))


def signatures_of(
    models: Sequence[FaultModel], signals: tuple[str, ...], law: RunLaw, signed: str = ""
) -> FaultSignatures:
    """Signatures in the relations of a law; by ``signals``, the names of those of a window.

    ``signed`` is the channel whose sign is a signal as well; empty: none is. A size without a bound
    reaches at least ``WIDE`` times what half of the recordings show.
    """
    made = FaultSignatures.of(models, law.relations, Basis(signals), signed)
    shown = {(row.fault, row.size): row.onset for row in law.visible}
    reach = np.ones(made.shape)
    for k, model in enumerate(made.models):
        for i, size in enumerate(model.sizes):
            onset = shown.get((model.fault, size.name), math.inf)
            reach[k, i] = WIDE * onset if math.isfinite(onset) else 1.0
    return replace(made, reach=reach)


def _feigned(law: RunLaw, signatures: FaultSignatures) -> tuple[SizePrior, SizePrior]:
    """Sizes of every model that healthy recordings feign, as a whole and from an onset on.

    One prior for both where the law knows nothing of onsets.
    """
    known = {(r.fault, r.size): (r.mean, r.sigma, r.begun_sigma) for r in law.feigned}
    rows = np.zeros((3, *signatures.shape))
    for k, model in enumerate(signatures.models):
        for i, size in enumerate(model.sizes):
            rows[:, k, i] = known.get((model.fault, size.name), (0.0, 0.0, 0.0))
    free = np.full(signatures.shape, np.inf)
    mean, whole, begun = rows
    prior = SizePrior(mean, whole, -free, free)
    return prior, prior if (whole == begun).all() else replace(prior, sigma=begun)


def session_variance(columns: LawColumns) -> Array:
    """What is free in each run, by its tolerance: the recordings may be of one session."""
    return np.array([c.tolerance**2 if c.kind == FREE else 0.0 for c in columns.columns])


def unit_variance(law: RunLaw, columns: LawColumns) -> Array:
    """What another unit draws anew: parameters, zeros of its sensors, temperatures of its parts.

    Its sensors are other ones, on other channels: their zeros differ by the tolerance of the
    description, whatever units on one channel have shown.
    """
    warm = [
        OTHER_UNIT_K**2 if t.kind == NEGLECTED and t.name.endswith("_temperature: one") else 0.0
        for t in law.terms
    ]
    return np.maximum(law.unit_variance, np.maximum(session_variance(columns), warm))
