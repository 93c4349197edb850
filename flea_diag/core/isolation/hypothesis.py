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

"""A fault under consideration, and what was compared with its predictions."""

from __future__ import annotations

from dataclasses import dataclass, field

from flea_diag.core.faults.fault import Fault
from flea_diag.core.likelihood.fit import Fit


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
