"""Likelihood of the hypotheses that qualitative isolation leaves, with sizes and errors.

Residuals y of the window are explained as y = Phi theta + Psi eta + noise: theta the sizes of
one fault (bounded), eta what another healthy unit of the design may differ by (Gaussian,
``UnitTolerance``), noise coloured with so many samples to one independent one. Everything is
kept as normal equations (sums over samples), so a hypothesis costs a small solve, however
long the episode:

    J_h = min_theta,eta  sum (y - Phi theta - Psi eta)^2 / (c sigma^2) + eta' Lambda eta
    log L_h = (J_0 - J_h) / 2 - dim(theta) ln(n) / 2          (BIC; J_0 without a fault)

Only sizes that are not 0 count as dimensions, and as n the independent samples of the residuals
that any of the faults moves.

After Biswas et al. and Willsky and Jones: parameter estimation takes over where signs do not
help any further.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from flea_diag.core.likelihood.basis import Basis
from flea_diag.core.likelihood.bounded_systems import BoundedSystems
from flea_diag.core.likelihood.fault_models import FaultModel, Term
from flea_diag.core.likelihood.fit import Fit, Solution
from flea_diag.core.likelihood.model_stack import ModelStack
from flea_diag.core.residuals.unit_difference import Unit

Array = npt.NDArray[np.float64]

FOLD = 50
"""Samples that are summed at once: always the same ones, so that sums have the same last bits."""


class NormalEquations:
    """Normal equations of every residual over an episode, in the signals of ``basis``.

    Constant memory.
    """

    def __init__(self, residuals: Sequence[str], basis: Basis, block_scans: int = FOLD) -> None:
        self.residuals, self.basis = tuple(residuals), basis
        self._least_block = max(block_scans, FOLD)
        count, width = len(self.residuals), len(basis.names)
        self._gram = np.zeros((count, width, width))
        self._cross = np.zeros((count, width))
        self._square = np.zeros(count)
        self.samples = np.zeros(count)
        self._spacing = np.ones(count)
        self._means = np.zeros((count, 1 + width, 1 + width))
        self.blocks = np.zeros(count)
        """Blocks of each residual, ``block_scans`` or ``FOLD`` long, at least half with values."""
        self._block, self._block_samples = np.zeros((count, 1 + width)), np.zeros(count)
        self._block_scans = 0
        self._values, self._phi = np.empty((FOLD, count)), np.empty((FOLD, width))
        self._waiting = 0

    def add(self, values: Array, regressors: Array) -> None:
        """N samples: residuals, shape (n, residuals), NaN = none, and basis signals."""
        for start in range(0, len(values), FOLD):
            part = slice(start, start + FOLD)
            self._wait(values[part], regressors[part])

    def _wait(self, values: Array, regressors: Array) -> None:
        """Buffer samples until ``FOLD`` are there: the sums do not depend on block sizes."""
        room = FOLD - self._waiting
        for some, more in ((values[:room], regressors[:room]), (values[room:], regressors[room:])):
            rows = slice(self._waiting, self._waiting + len(some))
            self._values[rows], self._phi[rows] = some, more
            self._waiting += len(some)
            if self._waiting == FOLD:
                self._fold()

    def _fold(self) -> None:
        """Add the buffered samples to the sums."""
        if not self._waiting:
            return
        values, phi = self._values[: self._waiting], np.nan_to_num(self._phi[: self._waiting])
        shared: dict[bytes, tuple[Array, Array, Array]] = {}
        for index, known in enumerate(np.isfinite(values).T):
            if not known.any():
                continue
            # Residuals that have a value in the same scans share what the signals add.
            key = known.tobytes()
            if key not in shared:
                own = phi[known]
                shared[key] = own, own.T @ own, own.sum(axis=0)
            signals, gram, total = shared[key]
            y = values[known, index]
            self._gram[index] += gram
            self._cross[index] += y @ signals
            self._square[index] += y @ y
            self.samples[index] += len(y)
            self._block[index, 0] += y.sum()
            self._block[index, 1:] += total
            self._block_samples[index] += len(y)
        self._block_scans += self._waiting
        self._waiting = 0
        if self._block_scans >= self._least_block:
            self._end_block()

    def _end_block(self) -> None:
        """Add the products of the means of this block."""
        enough = 2 * self._block_samples >= self._block_scans
        mean = self._block[enough] / self._block_samples[enough, None]
        self._means[enough] += mean[:, :, None] * mean[:, None, :]
        self.blocks[enough] += 1.0
        self._block[:], self._block_samples[:], self._block_scans = 0.0, 0.0, 0

    def fade(self, share: float) -> None:
        """Scale all sums by ``share``."""
        self._fold()
        every = (self._gram, self._cross, self._square, self.samples, self._means, self.blocks)
        for sums in every:
            sums *= share

    def take(self, other: NormalEquations, times: float) -> None:
        """Add other evidence, each of its samples counted ``times``."""
        other._fold()
        self._gram += times * other._gram
        self._cross += times * other._cross
        self._square += times * other._square
        self.samples += times * other.samples
        self._means += times * other._means
        self.blocks += times * other.blocks

    @property
    def shown(self) -> Array:
        """Of each residual the sum of squares of its block means, shape (residuals,)."""
        self._fold()
        return self._means[:, 0, 0]

    def foreseen(self, phi: Array, model: FaultModel, sizes: Sequence[float]) -> NormalEquations:
        """Expected evidence after a planned window in which ``model`` is present.

        Without noise: ``phi`` are the window's regressors, shape (samples, regressors); residuals
        without a sample so far have none then either.
        """
        self._fold()
        sum_of = NormalEquations(self.residuals, self.basis)
        known = np.nan_to_num(phi)
        gram = known.T @ known
        for index, name in enumerate(self.residuals):
            here = float(self.samples[index] > 0)
            effect = _effect(model, name, sizes, self.basis)
            sum_of._gram[index] = self._gram[index] + here * gram
            sum_of._cross[index] = self._cross[index] + here * (gram @ effect)
            sum_of._square[index] = self._square[index] + here * float(effect @ gram @ effect)
            sum_of.samples[index] = self.samples[index] + here * len(phi)
        return sum_of

    def showing(self, model: FaultModel, sizes: Sequence[float]) -> NormalEquations:
        """The same evidence, had ``model`` been present in these sizes throughout."""
        self._fold()
        sum_of = NormalEquations(self.residuals, self.basis)
        sum_of.take(self, 1.0)
        for index, name in enumerate(self.residuals):
            effect = _effect(model, name, sizes, self.basis)
            added = self._gram[index] @ effect
            sum_of._cross[index] += added
            sum_of._square[index] += 2.0 * float(effect @ self._cross[index]) + effect @ added
        return sum_of

    def fit(
        self,
        models: Sequence[FaultModel],
        sigma: Mapping[str, float],
        correlation: Mapping[str, float],
        tolerance: Sequence[float],
        baseline: NormalEquations | None = None,
        baseline_residuals: Collection[str] = (),
    ) -> tuple[Fit, ...]:
        """Fits of all ``models``, in their order.

        ``sigma`` is the nominal scatter of each residual and ``correlation`` the samples to
        one independent sample; ``tolerance`` is in the order of the basis's differences. The
        unit's ``baseline``, in the residuals ``baseline_residuals``, narrows that tolerance.
        """
        self._fold()
        self._spacing = np.array([correlation[name] for name in self.residuals])
        weight = 1.0 / (self._spacing * np.square([sigma[name] for name in self.residuals]))
        unit = Unit.of(tolerance)
        if baseline is not None:
            known = weight * [name in baseline_residuals for name in self.residuals]
            shown = baseline._stack((None,)).systems(known, Unit.unknown(len(tolerance)))
            unit = unit.shown(shown.A[0], shown.b[0])
        stacks = [self._stack(alike) for alike in _of_equal_size(models)]
        systems = [stack.systems(weight, unit) for stack in stacks]
        means = self._means.copy()  # as they are now: a fit is asked for details later
        dispersion = self._dispersion(stacks, systems, weight)
        if (dispersion != 1.0).any():
            weight = weight / dispersion
            systems = [stack.systems(weight, unit) for stack in stacks]
        square = float(weight @ self._square)
        nominal = self._stack((None,)).systems(weight, unit).misfit(0, square)
        moved = {term.residual for model in models for term in model.terms}
        counts = self.samples / self._spacing * [name in moved for name in self.residuals]
        independent = max(float(counts.sum()), 2.0)
        found: dict[int, Fit] = {}
        for stack, solved in zip(stacks, systems, strict=True):
            fits = self._fits(stack, solved, nominal, weight, unit, independent, means)
            found |= {id(model): fit for model, fit in fits}
        return tuple(found[id(model)] for model in models)

    def _stack(self, models: Sequence[FaultModel | None]) -> ModelStack:
        """Models of equal numbers of sizes, on the sums so far."""
        count = 0 if models[0] is None else len(models[0].sizes)
        terms = [() if model is None else model.terms for model in models]
        made = [_designs(each, self.residuals, count, self.basis) for each in terms]
        distinct = {id(design): design for design in made}
        order = {key: place for place, key in enumerate(distinct)}
        designs = np.stack([*distinct.values()])
        places = [order[id(design)] for design in made]
        return ModelStack(models, places, designs, np.matmul(self._gram, designs), self._cross)

    def _dispersion(
        self, stacks: Sequence[ModelStack], systems: Sequence[BoundedSystems], weight: Array
    ) -> Array:
        """Excess scatter of each residual over noise, under the model that fits it best.

        Where even that leaves a misfit of phi > 1 for each independent sample, the variance of
        this residual is scaled by phi (quasi-likelihood); other residuals are not affected.
        """
        least = np.full(len(self.residuals), np.inf)
        for stack, solved in zip(stacks, systems, strict=True):
            misfits = self._misfits(stack, solved.solutions, weight)
            least = np.minimum(least, np.minimum.reduce(misfits, axis=0))
        independent = np.maximum(self.samples / self._spacing, 1.0)
        return np.maximum(1.0, np.where(np.isfinite(least), least, 0.0) / independent)

    def _fits(
        self,
        stack: ModelStack,
        systems: BoundedSystems,
        nominal: float,
        weight: Array,
        unit: Unit,
        independent: float,
        means: Array,
    ) -> Iterator[tuple[FaultModel, Fit]]:
        """Fits of all models of a stack, in any order."""
        square = float(weight @ self._square)
        rough = [k for k, model in enumerate(stack.faults) if model.roughness > 0.0]
        for k, model in enumerate(stack.faults):
            if model.roughness == 0.0:
                gain = 0.5 * (nominal - systems.misfit(k, square))
                yield model, _fit(stack, systems, k, gain, independent, means)
        if not rough:
            return
        weights, losses = zip(
            *(self._roughened(stack.faults[k], systems.sizes(k), weight) for k in rough),
            strict=True,
        )
        part = stack.part(rough)
        systems = part.systems(np.stack(weights), unit)
        for k, model in enumerate(part.faults):
            misfit = systems.misfit(k, float(weights[k] @ self._square))
            gain = 0.5 * (nominal - misfit) - losses[k]
            yield model, _fit(part, systems, k, gain, independent, means)

    def _roughened(
        self, model: FaultModel, sizes: Sequence[float], weight: Array
    ) -> tuple[Array, float]:
        """Weights with the scatter of the fault's own effect added, and what that costs.

        The variance of each residual that the fault moves grows by (roughness * effect)^2; the
        Gaussian's normalisation then costs ln(growth) / 2 for each independent sample.
        """
        rough, loss = weight.copy(), 0.0
        moved = {term.residual for term in model.terms}
        for index, name in enumerate(self.residuals):
            if name not in moved or not self.samples[index]:
                continue
            effect = _effect(model, name, sizes, self.basis)
            if effect.any():
                square = float(effect @ self._gram[index] @ effect) / self.samples[index]
                # weight = 1 / (c sigma^2): growth is 1 + roughness^2 square / sigma^2.
                growth = 1.0 + model.roughness**2 * square * weight[index] * self._spacing[index]
                rough[index] /= growth
                loss += 0.5 * self.samples[index] / self._spacing[index] * np.log(growth)
        return rough, loss

    def _misfits(self, stack: ModelStack, unknowns: Array, weight: Array) -> Array:
        """Misfits at the joint optimum of each model, weighted, shape (models, residuals)."""
        effect = stack.effects(unknowns)
        quadratic = (effect * np.matmul(self._gram, effect[..., None])[..., 0]).sum(axis=-1)
        crossed = (effect * self._cross).sum(axis=-1)
        return np.asarray((self._square - 2.0 * crossed + quadratic) * weight)


def _of_equal_size(models: Sequence[FaultModel]) -> list[tuple[FaultModel, ...]]:
    """Models in groups of equal numbers of sizes."""
    groups: dict[int, list[FaultModel]] = {}
    for model in models:
        groups.setdefault(len(model.sizes), []).append(model)
    return [tuple(group) for group in groups.values()]


def _fit(
    stack: ModelStack,
    systems: BoundedSystems,
    k: int,
    gain: float,
    independent: float,
    means: Array,
) -> Fit:
    sizes = systems.sizes(k)
    nats = float(gain - _penalty(sizes, independent))
    solution = Solution(systems, k, stack.designs[stack.places[k]], means)
    return Fit(stack.faults[k].fault, nats, sizes, solution)


def _effect(model: FaultModel, residual: str, sizes: Sequence[float], basis: Basis) -> Array:
    """What a fault of these sizes adds to one residual, as a factor on each basis signal."""
    effect = np.zeros(len(basis.names))
    for term in model.terms:
        if term.residual == residual:
            effect[basis.column[term.regressor]] += term.gain * sizes[term.index]
    return effect


@lru_cache(maxsize=1024)
def _designs(
    terms: tuple[Term, ...], residuals: tuple[str, ...], count: int, basis: Basis
) -> Array:
    """Designs of all residuals, shape (residuals, signals, parameters); not to be changed."""
    return np.stack([_design(terms, name, count, basis) for name in residuals])


def _design(terms: tuple[Term, ...], residual: str, count: int, basis: Basis) -> Array:
    """How sizes and unit parameters enter one residual, shape (signals, parameters)."""
    design = np.zeros((len(basis.names), count + len(basis.differences)))
    for term in terms:
        if term.residual == residual:
            design[basis.column[term.regressor], term.index] += term.gain
    for own in basis.unit_terms:
        if own.residual == residual:
            place = count + basis.differences.index(own.difference)
            design[basis.column[own.regressor], place] += own.gain
    return design


def _penalty(sizes: Sequence[float], independent: float) -> float:
    """BIC: half a logarithm of the sample count for each size that is not 0.

    A size at a bound counts as fitted: otherwise the largest spall would be the simpler
    explanation of a weak jam, and the weakest jam that of lost lubrication.
    """
    fitted = sum(map(bool, sizes))
    return 0.5 * fitted * float(np.log(independent))
