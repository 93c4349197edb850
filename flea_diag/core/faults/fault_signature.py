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

"""Fault signatures, and their consistency with an observation.

A signature is an ordered pair of signs: magnitude (a jump at the onset) and slope (the first
nonzero derivative). It also holds the order of the first effect (Narasimhan et al. 2010,
section 3.1; Mosterman and Biswas 1999).

| predicted | fits an observation of +                   | where jumps are visible |
|-----------|--------------------------------------------|-------------------------|
| 0+        | slope +, 0 or not yet known                | the same                |
| ++        | slope +, 0 or not yet known                | slope + only            |
| +-        | slope -, 0 or not yet known                | slope - only            |
| +0        | slope +, 0 or not yet known                | slope 0 only            |
| 00        | never, any deviation refutes               | the same                |
| *         | always                                     | the same                |
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class FaultSignature:
    """Signs of magnitude and slope, order of the first effect (-1: none), and the reason.

    ``derivatives`` holds the sign of every order, for progressive monitoring. ``strength`` is
    the effect of a fault of reference size within one second, in standard deviations of the
    sensor (0 if not computed).
    """

    magnitude: str
    slope: str
    order: int
    path: str
    derivatives: str = ""
    strength: float = 0.0

    @property
    def symbols(self) -> str:
        """``0-``, ``+-``, ``00``, ..."""
        return self.magnitude + self.slope

    @property
    def direction(self) -> str:
        """First sign of the residual: the magnitude, or the slope if there is no jump."""
        return self.magnitude if self.magnitude != "0" else self.slope

    @property
    def affected(self) -> bool:
        """Whether the fault affects this residual."""
        return self.symbols != "00"

    def __str__(self) -> str:
        return f"{self.symbols}({self.order})" if self.affected else "00"


UNAFFECTED = FaultSignature("0", "0", -1, "")


def signature(signs: str, path: str) -> FaultSignature:
    """Two-symbol signature of a sequence of derivative signs, order 0 first."""
    order = next((k for k, symbol in enumerate(signs) if symbol != "0"), -1)
    if order < 0:
        return UNAFFECTED
    slope = next((symbol for symbol in signs[1:] if symbol != "0"), "0")
    return FaultSignature(signs[0], slope, order, path, signs)


@dataclass(frozen=True)
class Compatibility:
    """Whether an observation is consistent with a prediction, and the reason in words."""

    fits: bool
    reason: str

    def __bool__(self) -> bool:
        return self.fits


def compatible(
    predicted: FaultSignature,
    observed_magnitude: str,
    observed_slope: str = "?",
    jump_visible: bool = False,
) -> Compatibility:
    """Compare one observed (magnitude, slope) with a predicted signature.

    Parameters
    ----------
    observed_magnitude, observed_slope : ``+``, ``-``, ``0`` or ``?`` (not yet known)
        A normal residual (0) refutes no fault: the effect may be below the threshold. A magnitude
        ``*`` deviates without a sign, and refutes what does not affect the residual.
    jump_visible
        Whether a jump can be distinguished from a fast rise on this residual. If not, a rise
        from zero (``0+``), a step (``+0``) and a growing jump (``++``) are indistinguishable.
    """
    said = f"observed {observed_magnitude}{observed_slope}, predicted {predicted.symbols}"
    if observed_magnitude in "0?":
        return Compatibility(True, f"{said}: a normal residual refutes no fault")
    if not predicted.affected:
        return Compatibility(False, f"{said}: this fault does not affect this residual")
    if observed_magnitude != "*" and predicted.direction not in (observed_magnitude, "*"):
        return Compatibility(False, f"{said}: opposite sign")
    if observed_slope == "?":
        return Compatibility(True, f"{said}: sign consistent, slope not yet known")
    if observed_slope not in _admitted(predicted, observed_magnitude, jump_visible):
        return Compatibility(False, f"{said}: sign consistent, slope inconsistent")
    return Compatibility(True, f"{said}: sign and slope consistent")


def _admitted(predicted: FaultSignature, observed: str, jump_visible: bool) -> str:
    slope = predicted.slope
    if slope == "*" or predicted.magnitude == "*":
        return "+-0"
    if predicted.magnitude == "0":
        return slope + "0"
    if jump_visible:
        return slope
    return (observed if slope == "0" else slope) + "0"
