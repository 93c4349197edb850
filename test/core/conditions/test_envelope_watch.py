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

"""Outside what a calibration has seen: what is widened, what abstains, and what goes on."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.signal import lfilter
from support import stands
from support.models import linear_ema as ema
from support.observed import FLEA_COUNTS
from support.places import SHIPPED_STANDS

from flea_diag.configuration.calibrations import learned
from flea_diag.configuration.description import compiled_relations
from flea_diag.configuration.stand import load_stand
from flea_diag.core.calibration.calibration_reader import from_mapping
from flea_diag.core.conditions.envelope_watch import EnvelopeWatch
from flea_diag.core.residual_values import ResidualRows
from flea_diag.core.residuals.leverage import (
    CalibrationEnvelope,
    LeverageBasis,
    TravelFactors,
)
from flea_diag.core.residuals.residual_bank import ResidualBank
from flea_diag.core.residuals.thermal import CORRECTION_S
from flea_diag.wire.records import OUTSIDE_CALIBRATION, AmbiguityGroup, DataQuality, Outcome

KERNEL = FLEA_COUNTS.kernel
MECHANICAL = ["parity_mechanical", "parity_mechanical_dn"]


def of(residuals: ResidualRows, scans: slice, *names: str) -> np.ndarray:
    """Values of these residuals."""
    return residuals.values[scans][:, stands.relations().residuals.columns(names)]


def watch_of(envelope: CalibrationEnvelope, backend: str = "auto") -> EnvelopeWatch:
    """A watch with the parameters of the nominal recordings."""
    parameters, period_s = stands.calibration().parameters, FLEA_COUNTS.period_s
    return EnvelopeWatch(envelope, stands.relations(), parameters, KERNEL, period_s, backend)


def residuals_of(rows: np.ndarray) -> ResidualRows:
    """Residuals of scans by the parameters of the nominal recordings."""
    parameters, relations = stands.calibration().parameters, stands.relations()
    bank = ResidualBank(parameters, relations, period_s=0.01, counts=FLEA_COUNTS)
    return bank.step(rows, frozen=False)


def part_of(residuals: ResidualRows, part: slice) -> ResidualRows:
    """Some of the scans; no reading is missing in them."""
    every = {name: getattr(residuals, name) for name in ResidualRows.__slots__}
    assert {name for name, of in every.items() if of is None} == {"noise", "doubt", "moved"}
    return ResidualRows(**{name: of[part] for name, of in every.items() if of is not None})


@cache
def columns(load_n: float) -> ema.Columns:
    """Twelve seconds, with this load from 4 to 8 s and 60 N else."""
    return ema.noisy(ema.run(seconds=12.0, load=lambda t: load_n if 4.0 < t < 8.0 else 60.0), 3)


def watched(load_n: float) -> tuple[ResidualRows, list[int], list[tuple[int, ...]]]:
    """Residuals that a watch left, the scans at which it turned, what was outside in each."""
    calibration = stands.calibration()
    watch = watch_of(calibration.envelope)
    rows = ema.rows(columns(load_n), ema.STAND)
    residuals = residuals_of(rows)
    turns, outside = [], []
    for k in range(len(rows)):
        part = slice(k, k + 1)
        one = part_of(residuals, part)
        if watch.step(rows[part], one) == 0:
            turns.append(k)
        watch.leave_out(one)
        residuals.values[part] = one.values
        outside.append(watch.outside)
    assert watch.place.variance() is None or load_n > 60.0
    return residuals, turns, outside


def test_within_what_was_seen_nothing_is_added_and_nothing_abstains() -> None:
    residuals, turns, _ = watched(60.0)
    assert turns == []
    assert np.isfinite(of(residuals, slice(100, None), *MECHANICAL)).all()


def test_a_load_far_beyond_silences_what_rests_on_it_and_nothing_else() -> None:
    """The relation of the winding at first, whose current is three times as large."""
    residuals, (begins, *_), outside = watched(420.0)
    assert begins >= 400 + KERNEL // 3
    names = list(LeverageBasis(stands.relations()).names)
    ends = max(k for k, place in enumerate(outside) if any(n < len(names) for n in place))
    assert 800 + 3 * KERNEL - 31 <= ends <= 800 + 3 * KERNEL + 31
    # The heat lasts longer than the load, and the resistance of the winding rests on it.
    stores = [row.name for row in stands.relations().predictions]
    hot = len(names) + stores.index("motor_temperature")
    for name, rests_on in (("parity_mechanical", ()), ("parity_electrical", (hot,))):
        rests_on = {names.index(name), *rests_on}
        silent = np.array([bool(rests_on & {*place}) for place in outside[100:]])
        gone = np.isnan(of(residuals, slice(100, None), name, f"{name}_dn"))
        assert (gone == silent[:, None]).all()
        assert silent.any()
    assert outside[-1] == (hot,)
    assert np.isnan(of(residuals, slice(1100, None), "motor_temperature")).all()


def test_limits_of_what_rests_on_heat_grow_in_proportion_to_it() -> None:
    """Up to half of the largest mean, then by as many times as it is more."""
    calibration, relations = stands.calibration(), stands.relations()
    rows = ema.rows(columns(60.0), ema.STAND)
    residuals = residuals_of(rows)
    p, current = (
        calibration.parameters,
        residuals.signals[:, relations.signals.index("motor_current")],
    )
    heat = np.nan_to_num(p.motor_heating_k_per_a2s * np.square(current - p.current_offset_a))
    share = FLEA_COUNTS.period_s / CORRECTION_S
    mean = lfilter([share], [1.0, share - 1.0], heat)
    most = 0.6 * float(mean.max())
    supplies = {"motor_temperature": most}
    seen = replace(calibration.envelope, relations=(), travel=None, supplies=supplies)
    watch = watch_of(seen)
    found = []
    for part in (slice(500), slice(500, None)):
        some = part_of(residuals, part)
        assert watch.step(rows[part], some) == len(some)
        found.append(watch.place.variance())
    expected = np.maximum(mean / most, 1.0)
    table = relations.residuals
    parts = [np.ones((500, len(table.rows))) if f is None else np.sqrt(f) for f in found]
    factor = np.concatenate(parts)
    heated = ("motor_temperature", "parity_electrical", "parity_electrical_dn")
    for name in (*heated, *(row.name for row in table.rows[table.innovation_columns])):
        assert factor[:, table.column(name)] == pytest.approx(expected, rel=1e-9)
    assert (factor[:, table.columns([*MECHANICAL, "nut_temperature"])] == 1.0).all()
    assert expected.max() > 1.5


@pytest.mark.parametrize("backend", ["numpy", "numba"])
def test_heat_is_known_but_that_from_beyond_the_ranges(backend: str) -> None:
    if backend == "numba":
        pytest.importorskip("numba")
    known = stands.calibration().envelope
    rows = ema.rows(columns(60.0), ema.STAND)
    residuals = residuals_of(rows)
    places = []
    for low, high in ((-20.0, 20.0), (-0.1, 0.1)):
        ranges = {**known.ranges, "motor_current": (low, high)}
        watch = watch_of(replace(known, ranges=ranges), backend)
        watch.step(rows, residuals)
        assert watch.place.supplied is not None
        places.append(watch.place.supplied)
    within, beyond = places
    assert np.isfinite(within).all()
    assert within[-1, 0] > 0.05
    assert np.isnan(beyond[600:, 0]).all()


def test_a_prediction_rests_on_what_supplies_it_and_on_no_place() -> None:
    """A load beyond the recordings, with less heat than they had: only the rest is less known."""
    known, relations = stands.calibration().envelope, stands.relations()
    watch = watch_of(replace(known, supplies={n: 10.0 * q for n, q in known.supplies.items()}))
    rows = ema.rows(columns(420.0), ema.STAND)
    watch.step(rows[:450], residuals_of(rows[:450]))
    beyond = watch.place.beyond
    assert beyond is not None
    table = relations.residuals
    predicted = table.columns(row.name for row in relations.predictions)
    assert (beyond[440:, table.columns(("parity_kinematic",))] > 1.0).all()
    assert (beyond[:, predicted] == 0.0).all()


def test_two_speeds_are_compared_unless_both_are_out_of_their_range() -> None:
    """A sensor at fault leaves the other within; a runaway takes both along."""
    calibration = learned(load_stand("wing"))
    relations = compiled_relations(SHIPPED_STANDS["wing"] / "actuator.yaml")
    known, read = relations.residuals, ("motor_speed", "d_actuator_position")
    places = [relations.signals.index(name) for name in read]
    (compared,) = known.of_relation("parity_speed")
    for faster, void in (((2.0, 0.0), False), ((0.0, 2.0), False), ((2.0, 2.0), True)):
        signals = np.zeros((100, len(relations.signals)))
        for place, times, name in zip(places, faster, read, strict=True):
            signals[50:, place] = times * calibration.envelope.ranges[name][1]
        motion, moving = np.zeros((100, 2)), np.ones(100, dtype=bool)
        values = np.zeros((100, len(known.rows)))
        residuals = ResidualRows(values, np.empty((100, 0, 0)), signals, motion, moving)
        known_here = calibration.envelope, relations, calibration.parameters
        EnvelopeWatch(*known_here, KERNEL, FLEA_COUNTS.period_s).leave_out(residuals)
        gone = np.isnan(residuals.values[:, compared])
        assert gone.tolist() == [False] * 50 + [void] * 50, faster
        assert not np.delete(np.isnan(residuals.values), compared, axis=1).any()


def test_blocks_turn_where_single_scans_do() -> None:
    calibration = stands.calibration()
    rows = ema.rows(columns(420.0), ema.STAND)
    residuals = residuals_of(rows)
    _, (begins, *_), _ = watched(420.0)
    assert watch_of(calibration.envelope).step(rows, residuals) == begins


def test_at_an_end_of_the_travel_a_residual_scatters_by_its_own_factor() -> None:
    calibration, relations = stands.calibration(), stands.relations()
    rows = ema.rows(columns(60.0), ema.STAND)
    position = rows[:, relations.residuals.channel("actuator_position")]
    low = float(np.quantile(position, 0.3))
    travel = TravelFactors((low, 1.0), {"parity_mechanical": (3.0, 1.0, 2.0)})
    known = replace(calibration.envelope, travel=travel)
    watch = watch_of(known)
    residuals = residuals_of(rows)
    watch.step(rows, residuals)
    factor = watch.place.travel
    column = relations.residuals.column("parity_mechanical")
    assert np.array_equal(factor[:, column], np.where(position < low, 3.0, 1.0))
    assert (np.delete(factor, column, axis=1) == 1.0).all()
    # Leverage and place are one excess seen twice: the larger counts.
    both = factor * np.sqrt(replace(watch.place, beyond=np.full_like(factor, 3.0)).variance())
    assert both[:, column] == pytest.approx(np.where(position < low, 3.0, 2.0))
    again = from_mapping(replace(calibration, envelope=known).to_mapping(), "here")
    assert again.envelope == known


@pytest.mark.slow
def test_the_verdict_names_the_range_and_is_not_observable_meanwhile() -> None:
    said = stands.replay(stands.pipeline(), stands.scans(columns(420.0)))
    rows = [r for q in stands.of(DataQuality, said) for r in q.channels]
    words = {r.reason for r in rows if r.channel == OUTSIDE_CALIBRATION}
    first = next(r.reason for r in rows if r.channel == OUTSIDE_CALIBRATION)
    assert first.startswith("load_force is 4")
    assert "N, -141 to 140 N was calibrated: " in first
    assert any(w.startswith("load_force") and "parity_mechanical_dn and" in w for w in words)
    assert first in words
    groups = stands.of(AmbiguityGroup, said)
    assert Outcome.NOT_OBSERVABLE in [g.outcome for g in groups if "load_force is 4" in g.words]
    assert [g.episode for g in groups] == [0] * len(groups)
    # The heat of the load lasts longer than the load.
    last = [r.reason for r in stands.of(DataQuality, said)[-1].channels]
    assert last[-1].startswith("motor_temperature is supplied with 0.0")
    gone = "motor_temperature, parity_electrical, parity_electrical_dn and the state observer"
    assert last[-1].endswith(f" was calibrated: {gone} not tested")
    assert groups[-1].outcome is Outcome.NOT_OBSERVABLE


def test_an_older_calibration_has_no_envelope() -> None:
    content = stands.calibration().to_mapping()
    assert from_mapping(content, "now") == stands.calibration()
    del content["envelope"]
    assert from_mapping(content, "older") == replace(stands.calibration(), envelope=None)
