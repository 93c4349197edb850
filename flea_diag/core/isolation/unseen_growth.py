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

"""How far an error that grows may have come before its detection without having been seen.

The models of a drift differ in how long ago it began. One that began long ago and grows fast would
have been detected long before. So its rate is bounded where its relation is tested at all times, as
the prediction of a temperature is: else a jump of that reading looks like a drift of some age.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from flea_diag.core.likelihood.fault_models import FaultModel

SLACK = 2.5
"""How much further than to its detection it may have come: ages differ by factors of two."""


class UnseenGrowth:
    """Bounds the rates of drifts.

    ``limits``: of residuals that are tested at all times, the windows (s) and limits of their
    means. ``elapsed`` and ``one`` name the basis signals of the time since a detection and of a
    constant.
    """

    def __init__(
        self, limits: Mapping[str, Sequence[tuple[float, float]]], elapsed: str, one: str
    ) -> None:
        self._limits, self._elapsed, self._one = limits, elapsed, one

    def bound(self, model: FaultModel) -> FaultModel:
        """The same model, with the largest rate that may have gone unseen; others as they are."""
        at = {(t.residual, t.regressor): t.gain for t in model.terms}
        found = [
            SLACK * limit / abs(rate) / (age_s - window_s)
            for (residual, regressor), rate in at.items()
            if regressor == self._elapsed and (residual, self._one) in at
            for age_s in [at[residual, self._one] / rate]
            for window_s, limit in self._limits.get(residual, ())
            if window_s < age_s
        ]
        if not found or len(model.sizes) != 1:
            return model
        (size,) = model.sizes
        low, high = max(size.low, -min(found)), min(size.high, min(found))
        return replace(model, sizes=(replace(size, low=low, high=high),))
