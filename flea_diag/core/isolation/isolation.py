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

"""Qualitative isolation: hypotheses from the first deviation, refined by every later symbol.

A hypothesis stays while, for every symbol observed, some alternative of the fault predicts it
in some quadrant that the window passed through (TRANSCEND: Mosterman and Biswas 1999;
Narasimhan et al. 2010, 3.1). A residual that looks normal never drops a hypothesis. Every
hypothesis ever considered keeps the record of what kept or dropped it. Single-fault
assumption.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence

from flea_diag.core.causal_graph.operating_point import Quadrant
from flea_diag.core.faults.fault import Fault
from flea_diag.core.faults.sensor_symptoms import SensorSymptoms
from flea_diag.core.invariant import distribution, finite
from flea_diag.core.isolation.hypothesis import ConsistencyCheck, Hypothesis
from flea_diag.core.isolation.missing_jump import Jump, begins_with_jump, missing_jump
from flea_diag.core.isolation.predicted_symbols import PredictedSymbols
from flea_diag.core.likelihood.fit import Fit
from flea_diag.core.signatures.signature import SignatureTable

KNOWN = 3e-3
"""Share to which the signals are known that effects are made of: an effect that is off by it leaves
this share squared of the likelihood ratio unexplained."""


class Isolation:
    """Hypotheses of one episode."""

    def __init__(
        self,
        faults: Mapping[str, Fault],
        tables: Mapping[Quadrant, SignatureTable],
        sensors: SensorSymptoms,
    ) -> None:
        self.symbols = PredictedSymbols(tables, sensors)
        self.hypotheses = {name: Hypothesis(fault) for name, fault in faults.items()}
        self._seen: dict[str, tuple[str, tuple[Quadrant, ...]]] = {}
        self.overruled: set[str] = set()
        """Residuals that have contradicted all of a settled group."""
        self.lacks_jump = False
        """Whether all that were left fit, and cannot be: then nothing that fits worse may."""

    def alive(self) -> list[Hypothesis]:
        """Hypotheses still possible, the most probable first, by name where equal."""
        left = [h for h in self.hypotheses.values() if not h.why_dropped]
        return sorted(left, key=lambda h: (-h.probability, h.name))

    def dropped(self) -> list[Hypothesis]:
        """Hypotheses ruled out, in the order of the catalogue."""
        return [h for h in self.hypotheses.values() if h.why_dropped]

    def resume(self, dropped: Mapping[str, str]) -> None:
        """Drop what was dropped of this episode before, for the same reasons: groups shrink."""
        for name in dropped.keys() & self.hypotheses.keys():
            self.hypotheses[name].why_dropped = dropped[name]
        self.normalise()

    def observe(
        self,
        stamp_ns: int,
        residual: str,
        magnitude: str,
        slope: str,
        quadrants: Iterable[Quadrant],
        settled: bool = False,
    ) -> None:
        """Compare one symbol with every remaining hypothesis.

        A symbol that contradicts all hypotheses of a ``settled`` group points to a second fault or
        to model error: it is recorded and rejects none.
        """
        visited = tuple(quadrants)
        self._seen[residual] = magnitude, visited
        judged = [
            (h, *self.symbols.judge(h.fault, residual, magnitude, slope, visited))
            for h in self.alive()
        ]
        overruled = settled and not any(kept for _, kept, _, _ in judged)
        if overruled and judged:
            self.overruled.add(residual)
        for hypothesis, fits, signature, words in judged:
            kept = fits or overruled
            if overruled:
                words = f"{words}; contradicts all remaining faults, not used for rejection"
            hypothesis.add(
                ConsistencyCheck(
                    stamp_ns,
                    residual,
                    magnitude + slope,
                    signature.symbols,
                    kept,
                    words,
                    signature.path,
                )
            )
        self.normalise()

    @property
    def seen(self) -> frozenset[str]:
        """Residuals that have deviated."""
        return frozenset(self._seen)

    def predicted(self) -> dict[str, frozenset[str]]:
        """Of each fault, ruled out or not, those of ``seen`` that deviate as it predicts.

        By magnitude alone: where two faults act on one residual, its slope is that of neither.
        """
        return {
            name: frozenset(
                residual
                for residual, (magnitude, visited) in self._seen.items()
                if self.symbols.judge(h.fault, residual, magnitude, "?", visited)[0]
            )
            for name, h in self.hypotheses.items()
        }

    def require(
        self,
        stamp_ns: int,
        symbols: Mapping[str, str],
        moved: Collection[str],
        settled: bool = True,
        followed_s: float = math.inf,
    ) -> None:
        """Drop faults whose defining symptom is absent, once it had time to appear.

        Noise and dropout are changes of noise, a dead sensor reads a constant. ``symbols`` are
        the magnitudes seen so far; ``moved`` the channels that moved since the detection. Before
        the group is ``settled`` only modes are dropped whose symptom comes with the detection.
        ``followed_s``: time since then.
        """
        for hypothesis in self.alive():
            absent = self.symbols.absent(hypothesis.fault, symbols, moved, settled, followed_s)
            if absent is not None:
                source, seen, words = absent
                hypothesis.add(ConsistencyCheck(stamp_ns, source, seen, "", False, words))
        self.normalise()

    def apply_likelihoods(self, stamp_ns: int, fits: Sequence[Fit], drop_nats: float) -> None:
        """Apply likelihoods; drop faults that are ``drop_nats`` below the most likely one.

        A hypothesis without a quantitative model is neither favoured nor dropped. Of a very large
        likelihood ratio ``KNOWN`` squared is no evidence.
        """
        best_fit: dict[str, Fit] = {}
        for fit in fits:
            if fit.log_likelihood >= best_fit.get(fit.fault, fit).log_likelihood:
                best_fit[fit.fault] = fit
        fitted = [h for h in self.alive() if h.name in best_fit]
        if not fitted:
            return
        best = max(best_fit[h.name].log_likelihood for h in fitted)
        drop_nats += KNOWN**2 * max(best, 0.0)
        for hypothesis in fitted:
            fit = best_fit[hypothesis.name]
            hypothesis.fit, hypothesis.log_likelihood = fit, fit.log_likelihood
            behind = best - fit.log_likelihood
            if behind > drop_nats:
                words = f"{behind:.1f} nats below the most likely fault (limit {drop_nats:.1f})"
                hypothesis.add(
                    ConsistencyCheck(
                        stamp_ns, "likelihood", f"{fit.log_likelihood:.2f}", "", False, words
                    )
                )
        self.normalise()

    @property
    def begins_with_jump(self) -> bool:
        """Whether all that are left are errors of a reading that begin with a jump of it."""
        left = [h for h in self.hypotheses.values() if not h.why_dropped]
        return bool(left) and all(begins_with_jump(h.fault) for h in left)

    def require_jumps(self, stamp_ns: int, jumps: Mapping[str, Jump]) -> None:
        """Drop all that are left, if each is an error that begins with a jump, and none was seen.

        What fits best and cannot be is no evidence for what fits worse: a group is not narrowed.
        """
        missing = [(h, missing_jump(h.fault, h.fit, jumps)) for h in self.alive()]
        if missing and all(words for _, words in missing):
            self.lacks_jump = True
            for hypothesis, words in missing:
                source = hypothesis.fault.channel
                hypothesis.add(ConsistencyCheck(stamp_ns, source, "0", "", False, words))

    def recur(self, stamp_ns: int, fits: Mapping[str, Fit]) -> None:
        """Faults that come and go take the place of those that stay: begin anew with them."""
        for name, old in self.hypotheses.items():
            new = self.hypotheses[name] = Hypothesis(old.fault)
            fit = fits.get(name)
            if fit is None:
                words = "does not explain what comes and goes"
                new.add(ConsistencyCheck(stamp_ns, "recurrence", "", "", False, words))
                continue
            new.fit, new.log_likelihood = fit, fit.log_likelihood
            words = f"explains each time that it came: {fit.log_likelihood:.1f} nats over no fault"
            new.add(ConsistencyCheck(stamp_ns, "recurrence", "", "", True, words))
            new.why_kept = words
        self.normalise()

    def update(self, stamp_ns: int, feature: str, symbol: str, left: Mapping[str, float]) -> None:
        """Apply a feature value: ``left`` are the remaining faults, with probabilities."""
        for hypothesis in self.alive():
            kept = hypothesis.name in left
            words = "consistent with the feature value" if kept else "feature value contradicts it"
            hypothesis.add(ConsistencyCheck(stamp_ns, feature, symbol, "", kept, words))
            after = left.get(hypothesis.name, 0.0)
            if after > 0.0 and hypothesis.probability > 0.0:
                hypothesis.log_features += math.log(after / hypothesis.probability)
            hypothesis.probability = after
        shares = [hypothesis.probability for hypothesis in self.alive()]
        if shares:
            distribution("probabilities after a feature", shares)

    def normalise(self) -> None:
        """Normalise the probabilities of the remaining hypotheses, from equal priors."""
        alive = [h for h in self.hypotheses.values() if not h.why_dropped]
        if not alive:
            return
        evidence = [h.log_likelihood + h.log_features for h in alive]
        finite("evidence of the hypotheses", evidence)
        best = max(evidence)
        weights = [math.exp(each - best) for each in evidence]
        for hypothesis, weight in zip(alive, weights, strict=True):
            hypothesis.probability = weight / sum(weights)
