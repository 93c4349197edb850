"""Output of the state observer as a loop, for numba to compile: the same bits as in numpy.

In numpy it is ``stages.state_estimate.StateEstimate`` with ``innovation_residual.normalised``.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from flea_diag.core.observers.driven_model import STATES
from flea_diag.core.observers.observer_block import ALL, PREDICTED
from flea_diag.core.residuals.residual_rows import INNOVATION_CHANNELS, INNOVATION_COLUMNS

Array = npt.NDArray[np.float64]
Counts = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]

TESTED = np.array([PREDICTED.index(channel) for channel in INNOVATION_CHANNELS])
"""Places of the channels whose innovations are tested."""
SPEED = STATES.index("speed_m_s")
_FIRST = INNOVATION_COLUMNS.start


def output_loops(
    innovations: tuple[Array, Counts, Flags], testable: Flags, frozen: bool, channels: Counts,
    told: tuple[Array, Array, Array], values: Array,
) -> None:  # fmt: skip
    """Scan after scan into ``told``, estimates, sigmas and health, and into the residuals.

    ``channels`` are those reported, ``testable`` whether innovations may be tested.
    """
    table, measured, lost = innovations
    estimates, sigmas, health = told
    for i in range(len(table)):
        row = table[i]
        for k in range(len(channels)):
            sigma = row[2 * ALL + channels[k]]
            estimates[i, k] = row[channels[k]]
            sigmas[i, k] = math.nan if sigma == 0.0 else sigma
        health[i, 0], health[i, 1] = row[-1], row[-2] / max(measured[i], 1)
        health[i, 2] = lost[i] and not frozen
        sign = math.copysign(1.0, row[3 * ALL + SPEED])
        for k in range(len(TESTED)):
            sigma, found = row[2 * ALL + TESTED[k]], math.nan
            if testable[i] and not frozen and sigma > 0.0:
                found = row[ALL + TESTED[k]] / sigma
            values[i, _FIRST + 2 * k] = found
            values[i, _FIRST + 2 * k + 1] = found * sign
