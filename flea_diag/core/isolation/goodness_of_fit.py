"""Whether a hypothesis fits by itself: what it leaves is no more than healthy data show.

The most likely fault may still be a poor one. So the block means of each relation, without what the
fault and the unit account for, are held against the scatter of the same means in nominal
recordings: a chi-square with as many degrees of freedom as there are independent blocks, at the
level of the relation's own test, whose limit was learned out of sample. A relation that the fault
should move and that stays quiet counts as well as one that deviates by itself.

Models of faults hold to some percent only, and what they leave of a large fault is larger than any
noise. A relation is held against a fault only where more of it is left than explained.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.likelihood.likelihood import FOLD, Fit, NormalEquations


@dataclass(frozen=True, slots=True)
class Misfit:
    """A relation that a hypothesis does not fit.

    ``scatter`` is what is left of its means, in that of nominal recordings, and ``limit`` the most
    that is healthy.
    """

    residual: str
    scatter: float
    limit: float


@dataclass(frozen=True, slots=True)
class MeanScatter:
    """Means over ``FOLD`` scans of one relation in nominal recordings.

    ``square``: their largest mean square, the unit squared. ``k``: limit of one mean, in sigmas.
    ``spacing``: blocks to one independent block. ``level``: the square of the largest mean over the
    longest window that is healthy, in ``square``: runs and units differ by a level that no number
    of blocks averages out.
    """

    square: float
    k: float
    spacing: float
    level: float

    @classmethod
    def of(cls, calibration: Calibration, residual: str) -> MeanScatter | None:
        """By the test of the shortest window, colour by the longest; None without limits."""
        limit = calibration.limit(residual)
        if limit is None or not limit.windows:
            return None
        windows = limit.windows
        short = min(windows, key=lambda row: row.window)
        long = max(windows, key=lambda row: row.window)
        square = max(c**2 + s**2 for c, s in zip(short.centre, short.sigma, strict=True))
        ratio = long.window * max(long.sigma) ** 2 / (short.window * max(short.sigma) ** 2)
        level = max(abs(c) + long.k * s for c, s in zip(long.centre, long.sigma, strict=True))
        square *= short.window / FOLD
        return cls(square, short.k, max(1.0, ratio), level**2 / square)

    def limit(self, blocks: float) -> float:
        """Largest mean square of so many means that is healthy, in ``square``."""
        return self.level + _limit(self.k, max(1.0, blocks / self.spacing))


class GoodnessOfFit:
    """Holds what fits leave against nominal recordings."""

    def __init__(self, calibration: Calibration) -> None:
        names = [limit.name for limit in calibration.limits]
        self._nominal = {name: MeanScatter.of(calibration, name) for name in names}

    def misfits(self, evidence: NormalEquations, fit: Fit) -> tuple[Misfit, ...]:
        """Relations that this fit does not explain, the worst first."""
        found = []
        rows = zip(evidence.residuals, evidence.blocks, evidence.shown, fit.left, strict=True)
        for name, blocks, shown, left in rows:
            nominal = self._nominal.get(name)
            if nominal is None or not blocks or left < 0.5 * shown:
                continue
            scatter, limit = left / (blocks * nominal.square), nominal.limit(float(blocks))
            if scatter > limit:
                found.append(Misfit(name, math.sqrt(scatter), math.sqrt(limit)))
        return tuple(sorted(found, key=lambda row: -row.scatter / row.limit))


@lru_cache(maxsize=256)
def _limit(k: float, freedom: float) -> float:
    """Chi-square over its degrees of freedom, exceeded as rarely as ``k`` sigmas are."""
    from scipy.special import gammainccinv

    return float(2.0 * gammainccinv(freedom / 2.0, math.erfc(k / math.sqrt(2.0))) / freedom)
