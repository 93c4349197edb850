"""Envelope of a calibration: leverage of each relation on its nominal recordings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from flea_diag.core.calibration.nominal_trace import Trace
from flea_diag.core.calibration.travel_fit import travel_factors
from flea_diag.core.residuals.leverage import (
    PLACE,
    CalibrationEnvelope,
    LeverageBasis,
    LeverageFit,
    leverage_root,
    leverages,
)
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.core.scan_counts import ScanCounts

Array = npt.NDArray[np.float64]

REACH = 0.99
"""Share of the nominal scans within the reach of a calibration."""
MOST = 0.999
"""Share of them below its largest leverage: a spike of the acceleration is no operating point."""


def envelope(
    traces: Sequence[Trace], relations: RelationSet, counts: ScanCounts
) -> CalibrationEnvelope | None:
    """Envelope of the recordings; None where they show none."""
    basis = LeverageBasis(relations)
    position = traces[0].position_channel
    seen = [basis.rows(trace.signals, trace.position) for trace in traces]
    moving = np.concatenate([trace.moving for trace in traces])
    fits = []
    for place, name in enumerate(basis.names):
        end = (*basis.starts, basis.width)[place + 1]
        psi = np.concatenate([rows[:, basis.starts[place] : end] for rows in seen])
        # What is tested at rest, too, has seen the rests and the ways into them.
        tested = moving if name in relations.residuals.in_motion else np.ones_like(moving)
        psi = psi[tested & np.isfinite(psi).all(axis=1)]
        if len(psi) <= psi.shape[1] or not psi.std(axis=0).any():
            continue
        root = leverage_root(psi)
        h = leverages(psi, root, (0,))[:, 0]
        reach, most = np.quantile(h, (REACH, MOST)).tolist()
        table = tuple(map(tuple, root.tolist()))
        fits.append(LeverageFit(name, table, reach, most))
    if not any(fit.relation != PLACE for fit in fits):
        return None
    ranges = _ranges(traces, relations, position)
    return CalibrationEnvelope(position, tuple(fits), ranges, travel_factors(traces, counts))


def _ranges(
    traces: Sequence[Trace], relations: RelationSet, position: str
) -> dict[str, tuple[float, float]]:
    """Smallest and largest value of each signal and of the position."""
    found = {}
    columns = {name: [t.signals[:, k] for t in traces] for k, name in enumerate(relations.signals)}
    if position:
        columns[position] = [trace.position for trace in traces]
    for name, parts in columns.items():
        values = np.concatenate(parts)
        values = values[np.isfinite(values)]
        if len(values):
            found[name] = (float(values.min()), float(values.max()))
    return found
