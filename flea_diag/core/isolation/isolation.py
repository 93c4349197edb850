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
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from flea_diag.core.causal_graph.operating_point import Quadrant
from flea_diag.core.faults.fault import Fault
from flea_diag.core.faults.fault_signature import UNAFFECTED, FaultSignature, compatible
from flea_diag.core.faults.sensor_symptoms import SensorSymptoms
from flea_diag.core.invariant import distribution, finite
from flea_diag.core.isolation.missing_jump import Jump, begins_with_jump, missing_jump
from flea_diag.core.likelihood.fit import Fit
from flea_diag.core.signatures.signature import SignatureTable

JUMP_MODES = ("bias", "scaling", "dead", "dropout", "noise")
"""Modes that step. The position of a mass cannot jump: no fault of the plant has an effect of order
0 on it, so only the sensor's own faults move the residual that is its step."""
OWN_TESTS: Mapping[str, Mapping[str, str]] = {
    "noise": {"noise": "+", "dropout": "*", "dead": "-"},
    "stuck": {"dead": "+"},
    "dropout": {"dropout": "+"},
}
"""Effect of the modes of a sensor fault on the tests of that sensor alone (``sensor_tests``)."""
DEFINED_BY = {
    "noise": (("noise", "+"),),
    "dropout": (("dropout", "+"),),
    "dead": (("stuck", "+"), ("noise", "-")),
}
"""Modes defined by such a test: ruled out if none of these symbols appears in time."""
KNOWN = 3e-3
"""Share to which the signals are known that effects are made of: an effect that is off by it leaves
this share squared of the likelihood ratio unexplained."""
IMMEDIATE_MODES = ("noise", "dropout")
"""Modes that the sensor's own test detects no later than any mean of a relation does; loss of noise
and held readings take longer."""


@dataclass(frozen=True, slots=True)
class ConsistencyCheck:
    """One observation compared with the prediction of one hypothesis."""

    stamp_ns: int
    source: str
    observed: str
    predicted: str
    kept: bool
    words: str
    path: str = ""


@dataclass
class Hypothesis:
    """A fault under consideration; ``why_dropped`` is empty while it is alive.

    ``log_features``: log-likelihood added by feature values, up to a constant of the group.
    ``why_kept``: what speaks for it.
    """

    fault: Fault
    checks: list[ConsistencyCheck] = field(default_factory=list)
    why_dropped: str = ""
    why_kept: str = "consistent with all evidence so far"
    log_likelihood: float = 0.0
    log_features: float = 0.0
    fit: Fit | None = None
    probability: float = 0.0

    @property
    def name(self) -> str:
        """Fault id."""
        return self.fault.name

    def add(self, check: ConsistencyCheck) -> None:
        """Record a check; the first contradiction drops the hypothesis for good."""
        self.checks.append(check)
        if not check.kept and not self.why_dropped:
            self.why_dropped = f"{check.source}: {check.words}"


class Isolation:
    """Hypotheses of one episode."""

    def __init__(
        self,
        faults: Mapping[str, Fault],
        tables: Mapping[Quadrant, SignatureTable],
        sensors: SensorSymptoms,
    ) -> None:
        self._tables, self._sensors = tables, sensors
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
            (h, *self._judge(h.fault, residual, magnitude, slope, visited)) for h in self.alive()
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

    def _judge(
        self,
        fault: Fault,
        residual: str,
        magnitude: str,
        slope: str,
        visited: tuple[Quadrant, ...],
    ) -> tuple[bool, FaultSignature, str]:
        predictions = list(self._predictions(fault, residual, visited))
        last = UNAFFECTED, "this fault does not affect this residual"
        for signature in predictions:
            verdict = compatible(signature, magnitude, slope)
            if verdict:
                return True, signature, verdict.reason
            if signature.affected:
                last = signature, verdict.reason
        return False, *last

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
                if self._judge(h.fault, residual, magnitude, "?", visited)[0]
            )
            for name, h in self.hypotheses.items()
        }

    def _predictions(
        self, fault: Fault, residual: str, visited: tuple[Quadrant, ...]
    ) -> Iterable[FaultSignature]:
        channel, _, test = residual.rpartition("_")
        if test in OWN_TESTS:
            yield _own(fault, (channel,), OWN_TESTS[test].get(fault.mode, "0"), test)
            return
        if residual in self._sensors.positions:
            yield _own(fault, (residual,), "*" if fault.mode in JUMP_MODES else "0", "jump")
            for quadrant in visited:
                yield from steps(fault, self._tables[quadrant], self._sensors)
            return
        if residual in self._sensors.own:
            yield _own(fault, self._sensors.own[residual], "*", "level")
            return
        for quadrant in visited:
            table = self._tables[quadrant]
            for variant in table.variants[fault.name]:
                if residual in variant.row:
                    yield variant.row[residual]

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
            absent = self.absent(hypothesis.fault, symbols, moved, settled, followed_s)
            if absent is not None:
                source, seen, words = absent
                hypothesis.add(ConsistencyCheck(stamp_ns, source, seen, "", False, words))
        self.normalise()

    def absent(
        self,
        fault: Fault,
        symbols: Mapping[str, str],
        moved: Collection[str],
        settled: bool = True,
        followed_s: float = math.inf,
    ) -> tuple[str, str, str] | None:
        """Source, symbol and words of what defines a fault and is absent; as of ``require``."""
        shown_s = self._sensors.death_s.get(fault.channel, 0.0)
        unseen = fault.channel in self._sensors.death_unseen or followed_s < shown_s
        if fault.mode == "dead" and unseen:
            return None
        defining = DEFINED_BY.get(fault.mode, ())
        tests = [f"{fault.channel}_{test}" for test, _ in defining]
        source, seen = (tests or [""])[0], [symbols.get(test, "0") for test in tests]
        if fault.mode == "dead" and fault.channel in self._sensors.motion:
            # A channel whose reading still follows the motion is not dead.
            source, words = fault.channel, f"{fault.channel} still follows the motion"
            ruled_out = fault.channel in moved
        else:
            words = f"{fault.channel} shows no symptom of {fault.mode}"
            wanted = [symbol for _, symbol in defining]
            timely = settled or self._shows_at_once(fault, symbols)
            ruled_out = timely and bool(defining) and not any(map(str.__eq__, seen, wanted))
        return (source, "".join(seen[:1]), words) if ruled_out else None

    def _shows_at_once(self, fault: Fault, symbols: Collection[str]) -> bool:
        """Whether the sensor's own test responds first: neither its jump nor a twin has deviated.

        Twins read one motion: faults of either show in their difference before its own test.
        """
        jumped = fault.channel in self._sensors.positions and fault.channel in symbols
        twins = any(name in symbols for name in self._sensors.twins)
        return fault.mode in IMMEDIATE_MODES and not jumped and not twins

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


def steps(fault: Fault, table: SignatureTable, sensors: SensorSymptoms) -> Iterator[FaultSignature]:
    """Of a fault of the plant with which the difference of two positions jumps: one steps."""
    for variant in () if fault.channel else table.variants[fault.name]:
        for twin in sensors.stretched:
            found = variant.row.get(twin, UNAFFECTED)
            if found.affected and found.order == 0:
                yield FaultSignature("*", "*", 0, found.path)


def _own(fault: Fault, channels: Collection[str], symbol: str, what: str) -> FaultSignature:
    """Signature of a residual that only the faults of its own sensors can move."""
    if fault.channel not in channels or symbol == "0":
        return UNAFFECTED
    return FaultSignature(symbol, "*", 0, f"{fault.name} -> {what} of {fault.channel}")
