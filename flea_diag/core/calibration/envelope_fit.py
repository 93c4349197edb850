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

"""Envelope of a calibration: leverage of relations on its nominal recordings, ends of travel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from flea_diag.core.calibration.limits.window_fit import LEAST_IN_REGION
from flea_diag.core.calibration.nominal_trace import Trace
from flea_diag.core.flag_runs import longest_run
from flea_diag.core.residuals.leverage import (
    PLACE,
    CalibrationEnvelope,
    LeverageBasis,
    LeverageFit,
    TravelFactors,
    leverage_root,
    leverages,
    stretches,
)
from flea_diag.core.residuals.parameters import ActuatorParameters
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.core.residuals.thermal import Heating, SupplyMean
from flea_diag.core.running_mean import rolling_means
from flea_diag.core.scan_counts import ScanCounts

Array = npt.NDArray[np.float64]

REST = "rest_s"
"""Name of the time at rest among the ranges."""
REACH = 0.99
"""Share of the nominal scans within the reach of a calibration."""
MOST = 0.999
"""Share of them below its largest leverage: a spike of the acceleration is no operating point."""


def envelope(
    traces: Sequence[Trace],
    relations: RelationSet,
    counts: ScanCounts,
    parameters: ActuatorParameters,
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
    ranges = _ranges(traces, relations, position) | _conditions(traces, counts)
    supplies = _supplies(traces, relations, parameters, counts.period_s)
    ends = travel_factors(traces, counts)
    return CalibrationEnvelope(position, tuple(fits), ranges, ends, supplies)


def _supplies(
    traces: Sequence[Trace],
    relations: RelationSet,
    parameters: ActuatorParameters,
    period_s: float,
) -> dict[str, float]:
    """Largest mean of what supplies each predicted store, where anything does."""
    means = (SupplyMean(relations, parameters, period_s).step(trace.signals) for trace in traces)
    largest = np.max([mean.max(axis=0) for mean in means], axis=0)
    names = (row.name for row in relations.predictions)
    return {name: most for name, most in zip(names, largest.tolist(), strict=True) if most > 0.0}


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


def _conditions(traces: Sequence[Trace], counts: ScanCounts) -> dict[str, tuple[float, float]]:
    """Range of each channel of a temperature, and of the time at rest; no test depends on them."""
    longest = max(longest_run(~trace.moving) for trace in traces) * counts.period_s
    found = {REST: (0.0, float(longest))}
    for name in traces[0].temperatures:
        ends = np.array([trace.temperatures[name] for trace in traces])
        ends = ends[np.isfinite(ends).all(axis=1)]
        if len(ends):
            found[name] = (float(ends[:, 0].min()), float(ends[:, 1].max()))
    return found


def travel_factors(traces: Sequence[Trace], counts: ScanCounts) -> TravelFactors | None:
    """Factors of the residuals that are tested in motion; None where no end needs any.

    The middle is where at least ``LEAST_IN_REGION`` recordings came. The factor of an end is the
    largest windowed mean of what a residual is there over the largest in the middle.
    """
    edges = _edges(traces)
    if edges is None:
        return None
    places = [stretches(trace.position, edges) for trace in traces]
    factors = {}
    for column, row in enumerate(traces[0].rows.rows):
        if row.gate != "moving":
            continue
        found = np.ones(3)
        for window in map(counts.of, row.windows_s):
            parts = [
                _largest(t, column, place, window) for t, place in zip(traces, places, strict=True)
            ]
            largest = np.max(parts, axis=0)
            if largest[1] > 0.0:
                found = np.maximum(found, largest / largest[1])
        if (found > 1.0).any():
            below, middle, above = found.tolist()
            factors[row.name] = (below, middle, above)
    return TravelFactors(edges, factors) if factors else None


def _edges(traces: Sequence[Trace]) -> tuple[float, float] | None:
    """Ends of the middle; None where the recordings have none in common."""
    known = [t.position[np.isfinite(t.position)] for t in traces if t.position_channel]
    known = [position for position in known if len(position)]
    if len(known) < LEAST_IN_REGION:
        return None
    low = sorted(float(position.min()) for position in known)[LEAST_IN_REGION - 1]
    high = sorted(float(position.max()) for position in known)[-LEAST_IN_REGION]
    return (low, high) if low < high else None


def _largest(trace: Trace, column: int, place: npt.NDArray[np.int64], window: int) -> Array:
    """Largest |windowed mean| of what lies in each stretch, shape (3,)."""
    values = trace.values[:, column]
    use = trace.moving & np.isfinite(values)
    if np.count_nonzero(use) < window:
        return np.zeros(3)
    parts = np.where(place[use, None] == np.arange(3), values[use, None], 0.0)
    largest: Array = np.abs(rolling_means(parts, window)).max(axis=0)
    return largest


def loaded(
    trace: Trace,
    envelope: CalibrationEnvelope | None,
    relations: RelationSet,
    parameters: ActuatorParameters,
    period_s: float,
) -> Trace:
    """The trace with its loads and what heats its stores, in the metric of the recordings."""
    if envelope is None:
        return trace
    _, supplied = Heating(relations, parameters, period_s, envelope).step(trace.signals)
    trace, metric = replace(trace, supplied=supplied), envelope.load_metric
    if not len(metric):
        return trace
    basis = LeverageBasis(relations)
    loads = basis.rows(trace.signals, trace.position)[:, basis.loads(metric)]
    return replace(trace, loads=np.nan_to_num(loads) @ metric)


def widened(trace: Trace, travel: TravelFactors | None) -> Trace:
    """The trace as a diagnosis tests it."""
    if travel is None:
        return trace
    factor = travel.table([row.name for row in trace.rows.rows])
    factor = factor[stretches(trace.position, travel.edges)]
    spread = trace.spread
    if spread is not None:
        spread = spread / factor[:, trace.rows.spreading, None]
    return replace(trace, values=trace.values / factor, spread=spread)
