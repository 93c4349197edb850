"""Innovations of the state observer as residuals, y - ŷ over its expected standard deviation.

They detect, and isolate nothing. A filter that corrects itself smears a faulty sensor into all
of its innovations, so their signs are those of no fault; once it is frozen, after a detection,
its open integral of the speed drifts away. Isolation is left to relations without a state
(Narasimhan et al. 2010, section 3.1, for detection).
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from flea_diag.core.observers.innovation_loops import SPEED, TESTED
from flea_diag.core.observers.observer_block import Innovations
from flea_diag.core.residuals.residual_rows import INNOVATION_INDEX

Array = npt.NDArray[np.float64]


def normalised(told: Innovations) -> Array:
    """Innovations over their sigmas, each as it is and times the sign of the estimated speed.

    Shape (scans, columns), order of ``INNOVATION_INDEX``; NaN where nothing was measured.
    """
    sigma = told.sigmas.take(TESTED, axis=1)
    sigma[~(sigma > 0.0)] = math.nan
    found = np.empty((len(sigma), len(INNOVATION_INDEX)))
    np.divide(told.residuals.take(TESTED, axis=1), sigma, out=found[:, ::2])
    sign = np.copysign(1.0, told.means[:, SPEED, None])
    np.multiply(found[:, ::2], sign, out=found[:, 1::2])
    return found
