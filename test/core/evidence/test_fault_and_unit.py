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

"""The recursions over windows against dense densities: faults, another unit, and both."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from flea_diag.core.evidence.change_evidence import ChangeEvidence
from flea_diag.core.evidence.fault_evidence import FaultEvidence
from flea_diag.core.evidence.friction import Friction
from flea_diag.core.evidence.hypotheses import StreamHypotheses, signatures_of
from flea_diag.core.evidence.hypothesis_bank import HypothesisBank
from flea_diag.core.evidence.stream_windows import LawScans, LawWindow, LawWindowMeans
from flea_diag.core.evidence.white_stream import WhiteStream
from flea_diag.core.likelihood.fault_models import FaultModel, Size, Term
from flea_diag.core.run_law.law_columns import FREE, UNIT, LawColumn, LawColumns
from flea_diag.core.run_law.run_law import FeignedSize, LawTerm, RelationNoise, RunLaw, VisibleSize
from flea_diag.core.run_law.run_windows import FORMED, WINDOW_S

RELATIONS = ("first", "second")
SIGNALS = ("one", "elapsed_s", "speed")
WIDE = Size("bias", "", -np.inf, np.inf)
MODELS = (
    FaultModel("bias", (WIDE,), (Term("first", "one", 1.0), Term("second", "one", -0.5))),
    FaultModel("drift", (WIDE,), (Term("first", "elapsed_s", 0.3),)),
    FaultModel("drag", (WIDE,), (Term("second", "speed", 0.8),)),
)
SIZE = 0.2
VISIBLE = tuple(VisibleSize(m.fault, "bias", "", SIZE, SIZE, SIZE) for m in MODELS)
TERMS = (LawTerm("zero", FREE, 0.3, 0.5, 0.6), LawTerm("friction", UNIT, -0.2, 0.1, 0.4))
NOISE = (RelationNoise("first", 0.6, 0.7, 0.6), RelationNoise("second", 0.4, 0.3, 0.8, (0.3,)))
LAW = RunLaw(TERMS, NOISE, ((0.01,), (0.0, 0.02)), 8, 1, 1e9, visible=VISIBLE)


def columns() -> LawColumns:
    design = np.zeros((2, 3, 2))
    design[0, 0, 0], design[:, 2, 1] = 1.0, (0.5, -0.4)
    entries = (LawColumn("zero", FREE, 0.6), LawColumn("friction", UNIT, 0.4))
    return LawColumns(RELATIONS, entries, design, 1)


NOTHING_HELD, NO_MOTION = np.zeros((2, 3)), np.zeros(5)


def hypotheses(*rooms: str, dry: np.ndarray = NOTHING_HELD) -> StreamHypotheses:
    signatures = signatures_of(MODELS, SIGNALS, LAW)
    return StreamHypotheses.of(LAW, columns(), signatures, Friction(dry, 2, 0.0), rooms=rooms)


def windows(values: np.ndarray, stands: slice = slice(0)) -> list[LawWindow]:
    speed, held = np.sin(0.4 * np.arange(len(values))), np.zeros(len(values), dtype=bool)
    held[stands] = True
    signals = [np.tile([1.0, 0.0, v], (2, 1)) for v in speed]
    rows = zip(values, signals, held.tolist(), strict=True)
    return [LawWindow(row, s, s, NO_MOTION, stood) for row, s, stood in rows]


def dense(count: int, onset: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[np.ndarray]]:
    """Mean and covariance under no fault, of another unit since, and effects of the models."""
    speed, since = np.sin(0.4 * np.arange(count)), (np.arange(count) >= onset).astype(float)
    one, zero = np.ones(count), np.zeros(count)
    psi = np.array([[one, zero], [0.5 * speed, -0.4 * speed]])  # columns, relations, windows
    lag = np.abs(np.subtract.outer(np.arange(count), np.arange(count)))
    noise = np.zeros((2, count, 2, count))
    for k, row in enumerate(NOISE):
        noise[k, :, k] = row.white**2 * np.eye(count) + row.coloured**2 * row.phi**lag
    shared = np.kron(np.linalg.inv(np.array([[1.0, 0.0], [-0.3, 1.0]])), np.eye(count))
    own = psi.reshape(2, -1)
    spread = np.diag([max(0.5**2 + 0.01, 0.6**2), 0.1**2 + 0.02])
    null = shared @ noise.reshape(2 * count, -1) @ shared.T + own.T @ spread @ own
    later = (psi * since).reshape(2, -1)
    unit = later.T @ np.diag([0.6**2, 0.4**2]) @ later
    elapsed = since * (np.arange(count) - onset + 0.5) * WINDOW_S
    effects = [np.concatenate(pair) for pair in (
        (since, -0.5 * since), (0.3 * elapsed, zero), (zero, 0.8 * since * speed),
    )]  # fmt: skip
    return own.T @ np.array([0.3, -0.2]), null, unit, effects


def drawn(count: int, seed: int) -> np.ndarray:
    mean, null, _, _ = dense(count, 0)
    y = np.random.default_rng(seed).multivariate_normal(mean, null)
    return np.asarray(y.reshape(2, count).T)


def nats(y: np.ndarray, mean: np.ndarray, covariance: np.ndarray) -> float:
    return float(multivariate_normal(mean, covariance).logpdf(y))


def unbounded(monkeypatch: pytest.MonkeyPatch) -> None:
    """No window counts less, and models are exact: what a dense density says."""
    monkeypatch.setattr("flea_diag.core.evidence.white_stream.BOUND", 1e9)
    monkeypatch.setattr("flea_diag.core.evidence.white_stream.MODEL_ERROR", 0.0)


def test_the_bank_holds_the_densities_of_faults_and_of_another_unit(monkeypatch) -> None:
    unbounded(monkeypatch)
    count, values = 12, drawn(12, seed=1)
    bank, y = HypothesisBank(hypotheses()), values.T.ravel()
    for window in windows(values):
        bank.add(window)
    found = bank.weighed()
    for row, onset in enumerate(bank.onsets.tolist()):
        mean, null, unit, effects = dense(count, onset)
        assert found.unit[row] == pytest.approx(
            nats(y, mean, null + unit) - nats(y, mean, null), abs=1e-6
        )
        for value, effect in zip(found.faults[row], effects, strict=True):
            spread = null + (10.0 * SIZE) ** 2 * np.outer(effect, effect)
            assert value == pytest.approx(nats(y, mean, spread) - nats(y, mean, null), abs=1e-6)


def test_a_fault_is_weighed_alone_and_with_another_unit(monkeypatch) -> None:
    unbounded(monkeypatch)
    monkeypatch.setattr(FaultEvidence, "_left", lambda self, sums, count: np.ones((2, 3)))
    values = drawn(14, seed=2)
    found = FaultEvidence(hypotheses(), 0, windows(values)).weighed()
    y, (mean, null, unit, effects) = values.T.ravel(), dense(14, 0)
    for k, effect in enumerate(effects):
        added = (10.0 * SIZE) ** 2 * np.outer(effect, effect)
        assert found.alone[k] == pytest.approx(
            nats(y, mean, null + added) - nats(y, mean, null), abs=1e-6
        )
        assert found.with_unit[k] == pytest.approx(
            nats(y, mean, null + unit + added) - nats(y, mean, null + unit), abs=1e-6
        )


def test_a_step_is_found_at_its_onset_and_what_smoothing_leaves_of_one_is_not() -> None:
    values = drawn(160, seed=3)
    stepped, spiked = values.copy(), values.copy()
    stepped[100:] += 3.0 * np.array([1.0, -0.5])
    spiked[100:102] += 30.0
    bank = HypothesisBank(hypotheses())
    for window in windows(stepped[:118]):
        bank.add(window)
    faults = bank.weighed().faults
    onset, model = np.unravel_index(faults.argmax(), faults.shape)
    assert MODELS[model].fault == "bias"
    assert abs(int(bank.onsets[onset]) - 100) <= 2
    right = FaultEvidence(hypotheses(), 100, windows(stepped)).weighed()
    assert right.every[0] > max(right.every[1:]) + 3.5
    assert FaultEvidence(hypotheses(), 100, windows(spiked)).weighed().every.max() < 5.0


def test_a_large_deviation_is_held_against_a_share_of_it() -> None:
    """A bias that takes a second to come is no other fault, though no model holds its rise."""
    values = drawn(60, seed=7)
    rise = 1.0 - np.exp(-np.arange(30) / 5.0)
    values[30:] += 400.0 * np.outer(rise, [1.0, -0.5])
    found = FaultEvidence(hypotheses(), 30, windows(values)).weighed()
    assert int(found.every.argmax()) == 0
    assert found.every[0] < 30 * 2 * 0.5 / 0.2**2, "nats a window and relation are bounded"


def test_friction_at_a_standstill_holds_what_it_can_and_no_more() -> None:
    dry, stood = np.zeros((2, 3)), slice(20, 60)
    dry[0, 0] = 12.0
    known = hypotheses(dry=dry)
    held, pushed = drawn(60, seed=8), drawn(60, seed=8)
    # Half of the friction is held, or the push grows to ten times as much, as a drift does.
    held[stood, 0] -= 6.0
    pushed[stood, 0] += 120.0 * np.linspace(0.0, 1.0, 40)
    quiet = FaultEvidence(known, 20, windows(held, stood)).weighed()
    assert quiet.alone.max() < 5.0
    assert FaultEvidence(hypotheses(), 20, windows(held)).weighed().alone.max() > 30.0
    assert FaultEvidence(known, 20, windows(pushed, stood)).weighed().alone.max() > 30.0


def test_a_window_that_passes_little_of_the_stroke_says_little() -> None:
    dry = np.zeros((2, 3))
    dry[0, 2] = 12.0
    friction, row = Friction(dry, 2, 80.0), np.zeros(2)
    signals = {v: np.tile([1.0, 0.0, v], (2, 1)) for v in (100.0, -20.0, 0.0)}
    made = {v: LawWindow(row, s, s, NO_MOTION, False) for v, s in signals.items()}
    np.testing.assert_array_equal(friction.loudness(made[100.0].read), [1.0, 1.0])
    np.testing.assert_array_equal(friction.loudness(made[-20.0].read), [2.0, 1.0])
    np.testing.assert_allclose(friction.loudness(made[0.0].read), [20.0**0.5, 1.0])
    unknown = Friction(dry, 2, 0.0)
    np.testing.assert_array_equal(unknown.loudness(made[0.0].read), [1.0, 1.0])


def test_an_onset_that_is_put_too_early_makes_no_drift_of_a_bias() -> None:
    values = drawn(70, seed=9)
    values[48:] += 2.5 * np.array([1.0, -0.1])
    every = windows(values)
    early = FaultEvidence(hypotheses(), 40, every)
    right = FaultEvidence(hypotheses(), 48, every)
    alone = ChangeEvidence([early]).weighed()
    assert alone.alone[1] > alone.alone[0] + 3.0
    both = ChangeEvidence([early, right]).weighed()
    assert both.alone[0] > alone.alone[0] + 3.0
    np.testing.assert_array_equal(both.size[0], right.weighed().size[0])
    parts = [one.unit + one.with_unit for one in (early.weighed(), right.weighed())]
    np.testing.assert_allclose(
        both.unit + both.with_unit, np.logaddexp(*parts) - np.log(2.0), atol=1e-9
    )


def test_onsets_that_are_weighed_together_are_weighed_by_the_same_windows() -> None:
    """A step between them would count for the early one alone, which lets a jam be a bias."""
    values = drawn(70, seed=10)
    values[48:] += 8.0 * np.array([1.0, -0.5])
    every = windows(values)
    alone = [FaultEvidence(hypotheses(), onset, every).weighed() for onset in (44, 48)]
    both = [FaultEvidence(hypotheses(), n, every, beside=(44, 48)).weighed() for n in (44, 48)]
    assert [one.windows.max() for one in alone] == [24.0, 20.0]
    assert [one.windows.max() for one in both] == [21.0, 20.0]
    assert alone[0].alone[2] > both[0].alone[2] + 5.0
    assert both[1].alone[0] > max(both[0].alone) + 3.0


def test_explanations_are_told_apart_once_the_motion_has_gone_both_ways_since_the_onset() -> None:
    """In one direction a drag and the error of a reading are alike."""
    every = windows(drawn(60, seed=12))  # at speeds of sin(0.4 n), whose sign turns each 8 windows
    change = ChangeEvidence([FaultEvidence(hypotheses(), 40, every[:46])])
    assert change.windows > change.told == 1.0
    for window in every[46:52]:
        change.add(window)
    assert change.told == change.windows > 6.0
    friction = Friction(NOTHING_HELD, 2, 20.0)
    assert [int(friction.way(every[n])) for n in (0, 4, 12)] == [0, 0, 0]
    assert [int(hypotheses().friction.way(every[n])) for n in (0, 4, 12)] == [0, 1, -1]


@pytest.mark.slow
def test_a_stream_is_known_for_as_long_as_the_recordings_of_its_law() -> None:
    signatures = signatures_of(MODELS, SIGNALS, LAW)
    made = [
        StreamHypotheses.of(
            LAW, columns(), signatures, Friction(NOTHING_HELD, 2, 0.0), recording_s=length_s
        )
        for length_s in (40.0, 1e12)
    ]
    assert [known.memory_s for known in made] == [40.0, LAW.time_constant_s]
    # A zero that creeps by as much as recordings differ in it, in ten minutes.
    values = np.zeros((3000, 2))
    values[:, 0] = 0.3 + np.linspace(0.0, 0.6, 3000)
    largest = []
    for known in made:
        bank = HypothesisBank(known)
        for window in windows(values):
            bank.add(window)
        largest.append(float(bank.weighed().faults[1:].max()))
    assert largest[0] < largest[1]


def test_another_unit_stands_in_another_room_only_where_more_than_the_room_has_changed() -> None:
    warmer, other = drawn(60, seed=5), drawn(60, seed=5)
    warmer[20:, 0] += 1.5
    friction = 1.5 * np.sin(0.4 * np.arange(20, 60))
    other[20:] += np.column_stack((1.5 + 0.5 * friction, -0.4 * friction))
    # A zero of the first relation is what a room differs by, its bias an error of a thermometer.
    of_room, of_unit = hypotheses("first"), hypotheses()
    lone, both = (
        FaultEvidence(of_room, 20, windows(values)).weighed() for values in (warmer, other)
    )
    assert lone.unit < lone.alone[0]
    assert both.unit > both.alone.max() + 3.5
    found = FaultEvidence(of_unit, 20, windows(warmer)).weighed()
    assert found.unit > lone.unit


def test_what_an_error_of_the_rooms_thermometer_does_to_a_part_says_nothing_of_the_room() -> None:
    """A thermocouple of the motor that had stepped was another unit in another room."""
    part = drawn(60, seed=5)
    part[20:, 1] -= 0.8  # of the bias alone, which moves the first relation twice as far
    in_room, anywhere = (
        FaultEvidence(of, 20, windows(part)).weighed() for of in (hypotheses("first"), hypotheses())
    )
    assert in_room.alone[0] > 1.0
    assert in_room.unit <= anywhere.unit


def test_from_before_a_healthy_recording_feigns_a_size_of_any_fault() -> None:
    feigned = (FeignedSize("drag", "bias", 0.0, 2.0, 2.0),)
    law = replace(LAW, feigned=feigned)
    signatures = signatures_of(MODELS, SIGNALS, law)
    known = StreamHypotheses.of(law, columns(), signatures, Friction(NOTHING_HELD, 2, 0.0))
    values = drawn(60, seed=6)
    values[:, 1] += 1.6 * np.sin(0.4 * np.arange(60))
    before = FaultEvidence(known, 0, windows(values)).weighed()
    assert before.healthy[2] > 10.0
    np.testing.assert_allclose(before.healthy[:2], before.healthy[2] - np.log(3.0), atol=1e-3)
    values[:20] = drawn(60, seed=6)[:20]
    since = FaultEvidence(known, 20, windows(values)).weighed()
    assert since.healthy[2] > 10.0
    assert (since.healthy[:2] == 0.0).all()


def test_what_begins_in_healthy_recordings_is_held_against_an_onset_alone() -> None:
    nats = []
    for onset_sigma in (0.0, 2.0):
        feigned = (FeignedSize("drag", "bias", 0.0, 0.1, 0.1, onset_sigma),)
        law = replace(LAW, feigned=feigned)
        signatures = signatures_of(MODELS, SIGNALS, law)
        known = StreamHypotheses.of(law, columns(), signatures, Friction(NOTHING_HELD, 2, 0.0))
        values = drawn(60, seed=6)
        values[20:, 1] += 1.6 * np.sin(0.4 * np.arange(20, 60))
        whole, since = (FaultEvidence(known, k, windows(values)).weighed() for k in (0, 20))
        nats.append((float(whole.healthy[2]), float(since.healthy[2])))
    assert nats[1][0] == nats[0][0]
    assert nats[1][1] > nats[0][1] + 10.0


def test_windows_of_a_stream_are_the_same_in_blocks_and_scans() -> None:
    draw = np.random.default_rng(4)
    names = ("one", "current", "load", "way", "second: current", "place")
    signals = ("one", "current", "load", "way", *FORMED)
    table, values = draw.standard_normal((95, 6)), draw.standard_normal((95, 2))
    values[3:40, 1] = np.nan

    stands = np.arange(95) >= 65
    acting = np.zeros((2, len(signals)), dtype=bool)
    acting[0, 2] = True
    table[40:52, 2] = np.nan

    def means() -> LawWindowMeans:
        motion = "current", "load", "way", "way"
        return LawWindowMeans(RELATIONS, signals, names, motion, acting, (-2.0, 2.0), 0.01, 20)

    whole, parts = means(), means()
    scans = LawScans(values, table, stands)
    every = list(whole.add(scans))
    single = [w for k in range(95) for w in parts.add(scans.part(slice(k, k + 1)))]
    assert [number for number, _ in every] == [19, 39, 59, 79]
    for (_, one), (_, other) in zip(every, single, strict=True):
        np.testing.assert_array_equal(one.values, other.values)
        np.testing.assert_array_equal(one.signals, other.signals)
        np.testing.assert_array_equal(one.motion, other.motion)
    assert np.isnan(every[0][1].values[1])
    assert np.isnan(every[2][1].values).tolist() == [True, False], "its load is missing"
    assert [window.stands for _, window in every] == [False, False, False, True]
    assert every[0][1].signals[0, 1] == pytest.approx(table[:20, 1].mean())


def test_a_large_deviation_says_little_of_the_noise_that_relations_share() -> None:
    """A hundred standard deviations of the first are no thirty of the second."""
    second = {}
    for beyond in (0.0, 1.0, 100.0):
        stream, values = WhiteStream(hypotheses()), drawn(40, seed=6)
        values[-1, 0] += beyond
        steps = [stream.step(window) for window in windows(values)]
        second[beyond] = steps[-1].deviations[1]
    assert abs(second[1.0] - second[0.0]) > 0.2
    assert abs(second[100.0] - second[0.0]) < 5.0


def test_a_relation_shares_no_noise_with_one_that_has_no_value() -> None:
    values = drawn(30, seed=10)
    values[:, 0] = np.nan
    known = hypotheses()
    apart = replace(known, noise=replace(known.noise, shared=np.zeros((2, 2))))
    streams = WhiteStream(known), WhiteStream(apart)
    for window in windows(values):
        one, other = (stream.step(window) for stream in streams)
        for found, expected in ((one.own[1], other.own[1]), (one.faults[1], other.faults[1])):
            np.testing.assert_array_equal(found, expected)
        assert one.errors[1] == other.errors[1]
        assert np.isnan(one.errors[0])
