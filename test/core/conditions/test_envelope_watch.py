"""Outside what a calibration has seen: what is widened, what abstains, and what goes on."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
from support import stands
from support.models import linear_ema as ema

from flea_diag.core.calibration.calibration_reader import from_mapping
from flea_diag.core.conditions.envelope_watch import EnvelopeWatch
from flea_diag.core.residuals.leverage import LeverageBasis, TravelFactors
from flea_diag.core.residuals.residual_bank import ResidualBank
from flea_diag.core.residuals.residual_rows import ResidualRows
from flea_diag.core.scan_counts import FLEA_COUNTS
from flea_diag.wire.records import OUTSIDE_CALIBRATION, AmbiguityGroup, DataQuality, Outcome

KERNEL = FLEA_COUNTS.kernel
MECHANICAL = ["parity_mechanical", "parity_mechanical_dn"]


def of(residuals: ResidualRows, scans: slice, *names: str) -> np.ndarray:
    """Values of these residuals."""
    return residuals.values[scans][:, stands.relations().residuals.columns(names)]


@cache
def columns(load_n: float) -> ema.Columns:
    """Twelve seconds, with this load from 4 to 8 s and 60 N else."""
    return ema.noisy(ema.run(seconds=12.0, load=lambda t: load_n if 4.0 < t < 8.0 else 60.0), 3)


def watched(load_n: float) -> tuple[ResidualRows, list[int], list[tuple[int, ...]]]:
    """Residuals that a watch left, the scans at which it turned, what was outside in each."""
    calibration, relations = stands.calibration(), stands.relations()
    watch = EnvelopeWatch(calibration.envelope, relations, KERNEL)
    rows = ema.rows(columns(load_n), ema.STAND)
    residuals = ResidualBank(calibration.parameters, relations).step(rows, frozen=False)
    turns, outside = [], []
    for k in range(len(rows)):
        part = slice(k, k + 1)
        one = ResidualRows(*(getattr(residuals, n)[part] for n in ResidualRows.__slots__))
        if watch.step(rows[part], one) == 0:
            turns.append(k)
        watch.leave_out(one)
        residuals.values[part] = one.values
        outside.append(watch.outside)
    assert watch.place.factor() is None or load_n > 60.0
    return residuals, turns, outside


def test_within_what_was_seen_nothing_is_added_and_nothing_abstains() -> None:
    residuals, turns, _ = watched(60.0)
    assert turns == []
    assert np.isfinite(of(residuals, slice(100, None), *MECHANICAL)).all()


def test_a_load_far_beyond_silences_what_rests_on_it_and_nothing_else() -> None:
    """The relation of the winding at first, whose current is three times as large."""
    residuals, (begins, *_, ends), outside = watched(420.0)
    assert begins >= 400 + KERNEL // 3
    assert 800 + 3 * KERNEL - 31 <= ends <= 800 + 3 * KERNEL + 31
    names = list(LeverageBasis(stands.relations()).names)
    for name in ("parity_mechanical", "parity_electrical"):
        silent = np.array([names.index(name) in place for place in outside[100:]])
        gone = np.isnan(of(residuals, slice(100, None), name, f"{name}_dn"))
        assert (gone == silent[:, None]).all()
        assert silent.any()
    assert outside[-1] == ()


def test_blocks_turn_where_single_scans_do() -> None:
    calibration, relations = stands.calibration(), stands.relations()
    rows = ema.rows(columns(420.0), ema.STAND)
    residuals = ResidualBank(calibration.parameters, relations).step(rows, frozen=False)
    _, (begins, *_), _ = watched(420.0)
    assert EnvelopeWatch(calibration.envelope, relations, KERNEL).step(rows, residuals) == begins


def test_at_an_end_of_the_travel_a_residual_scatters_by_its_own_factor() -> None:
    calibration, relations = stands.calibration(), stands.relations()
    rows = ema.rows(columns(60.0), ema.STAND)
    position = rows[:, relations.residuals.channel("actuator_position")]
    low = float(np.quantile(position, 0.3))
    travel = TravelFactors((low, 1.0), {"parity_mechanical": (3.0, 1.0, 2.0)})
    known = replace(calibration.envelope, travel=travel)
    watch = EnvelopeWatch(known, relations, KERNEL)
    residuals = ResidualBank(calibration.parameters, relations).step(rows, frozen=False)
    watch.step(rows, residuals)
    factor = replace(watch.place, beyond=None).factor()
    column = relations.residuals.column("parity_mechanical")
    assert np.array_equal(factor[:, column], np.where(position < low, 3.0, 1.0))
    assert (np.delete(factor, column, axis=1) == 1.0).all()
    # Leverage and place are one excess seen twice: the larger counts.
    both = replace(watch.place, beyond=np.full_like(factor, 3.0)).factor()
    assert np.array_equal(both[:, column], np.where(position < low, 3.0, 2.0))
    again = from_mapping(replace(calibration, envelope=known).to_mapping(), "here")
    assert again.envelope == known


def test_the_verdict_names_the_range_and_is_not_observable_meanwhile() -> None:
    said = stands.feed(stands.pipeline(), stands.scans(columns(420.0)))
    rows = [r for q in stands.of(DataQuality, said) for r in q.channels]
    words = {r.reason for r in rows if r.channel == OUTSIDE_CALIBRATION}
    first = next(r.reason for r in rows if r.channel == OUTSIDE_CALIBRATION)
    assert first.startswith("load_force is 4")
    assert "N, -141 to 140 N was calibrated: parity_mechanical, parity_mechanical_dn and" in first
    assert first in words
    groups = stands.of(AmbiguityGroup, said)
    assert Outcome.NOT_OBSERVABLE in [g.outcome for g in groups if "load_force is 4" in g.words]
    assert [g.episode for g in groups] == [0] * len(groups)
    assert groups[-1].outcome is Outcome.NOMINAL


def test_an_older_calibration_has_no_envelope() -> None:
    content = stands.calibration().to_mapping()
    assert from_mapping(content, "now") == stands.calibration()
    del content["envelope"]
    assert from_mapping(content, "older") == replace(stands.calibration(), envelope=None)
