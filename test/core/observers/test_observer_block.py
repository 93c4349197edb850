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

"""The observer gives the same bits for any division into blocks, with every filter."""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.observed import BACKENDS, HAVE_NUMBA, NOISE, P, recording

from flea_diag.configuration.description import compiled_relations
from flea_diag.core import backend as backends
from flea_diag.core.observers.observer_block import Innovations, Scans, row_layout
from flea_diag.core.observers.observer_loops import Places, join_loops, read_loops, sane_loops
from flea_diag.core.observers.state_observer import StateObserver

pytestmark = pytest.mark.slow

FLEA = compiled_relations("actuator.yaml").residuals

RELATIONS = compiled_relations("actuator.yaml")
FILTERS = [*(("optimal", backend) for backend in BACKENDS), ("kalman", "numpy")]
SCANS = 300
LAYOUT = row_layout(5, 2)


def observer(kind: str, backend: str, sampling: str = "mean") -> StateObserver:
    options = {"noise": NOISE, "kind": kind, "voltage_sampling": sampling}
    return StateObserver(P, RELATIONS, 0.01, np.random.default_rng(3), 50, backend, **options)


def eventful() -> np.ndarray:
    """What stops a compiled loop: missing channels, a winding that warms, a track that is lost."""
    rows = recording(SCANS).copy()
    for name, first, last in (
        ("motor_voltage", 50, 70),
        ("load_force", 60, 90),
        ("motor_current", 87, 88),
        ("ambient_temperature", 100, 115),
        ("motor_temperature", 0, 5),
    ):
        rows[first:last, FLEA.index[name]] = math.nan
    rows[150:, FLEA.index["motor_temperature"]] += 0.1 * np.arange(SCANS - 150)
    rows[200:, FLEA.index["actuator_position"]] = 9e5
    rows[225] = math.nan
    return rows


def told(made: StateObserver, rows: np.ndarray, lengths: list[int], frozen: tuple[int, int]):
    """All that is told, the rows cut into blocks of these lengths over and over."""
    tables, measured, diverged, start, turn = [], [], [], 0, 0
    edges = [*frozen, len(rows)]
    while start < len(rows):
        end = min(start + lengths[turn % len(lengths)], next(e for e in edges if e > start))
        found = made.follow(rows[start:end], frozen[0] <= start < frozen[1])
        tables.append(found.table)
        measured += found.measured.tolist()
        diverged += found.diverged.tolist()
        start, turn = end, turn + 1
    return np.concatenate(tables).tobytes(), measured, diverged


@pytest.mark.in_turn(2)
@pytest.mark.parametrize("sampling", ["mean", "instant_pwm"])
@pytest.mark.parametrize(("kind", "backend"), FILTERS)
@settings(max_examples=4, deadline=None)
@given(
    st.lists(st.integers(1, 100), min_size=1, max_size=5),
    st.tuples(st.integers(1, 125), st.integers(126, 250)),
)
def test_any_partition_gives_the_same_bits(kind, backend, sampling, lengths, frozen):
    rows = eventful()
    many = told(observer(kind, backend, sampling), rows, lengths, frozen)
    assert many == told(observer(kind, backend, sampling), rows, [1], frozen)


@pytest.mark.parametrize("backend", BACKENDS)
def test_the_rows_show_what_is_to_be_held_equal(backend):
    """The property above is not empty: a track is lost, a resistance renewed."""
    made = observer("optimal", backend)
    cold = made._model.winding_degc
    found = made.follow(eventful())
    assert made._model.winding_degc > cold
    assert found.diverged.any() or not np.isfinite(found.nis).all()
    assert len(set(found.measured.tolist())) > 3


@pytest.mark.skipif(not HAVE_NUMBA, reason="compares numba with numpy")
def test_both_backends_tell_the_same_of_a_block():
    rows = recording(300).copy()
    rows[80:90, FLEA.index["load_force"]] = math.nan
    one, two = (observer("optimal", backend).follow(rows) for backend in ("numpy", "numba"))
    np.testing.assert_allclose(one.table, two.table, rtol=1e-6, atol=1e-9)
    assert one.table.shape == (300, 29)


@pytest.mark.skipif(not HAVE_NUMBA, reason="compares numba with numpy")
@pytest.mark.parametrize("sampling", ["mean", "instant_pwm"])
def test_what_goes_in_and_out_has_the_same_bits_compiled(sampling):
    rows, made = eventful(), observer("optimal", "numba", sampling)
    rows[250, FLEA.index["commanded_voltage"]] = math.inf
    command = P.drive_offset_v, P.drive_gain
    columns, model = made._columns, made._model
    places = Places.of(columns, model.absent, model.driving)
    widths = map(len, (columns.inputs, columns.motion, columns.motion, columns.degc))
    scans, measured = [np.empty((len(rows), w)) for w in widths], np.empty(len(rows), np.int64)
    backends.exact(read_loops, sane_loops)(rows, places, command, tuple(scans), measured)
    plain = Scans.read(rows, made._columns, made._model.absent, command, made._model.driving)
    assert [part.tobytes() for part in scans] == [part.tobytes() for part in plain]
    assert measured.tolist() == np.isfinite(plain.y).sum(axis=1).tolist()
    raw = np.random.default_rng(4).standard_normal((300, LAYOUT.raw))
    raw[::7, LAYOUT.warm + 1] = math.nan
    lost, table = np.zeros(300, dtype=bool), np.empty((300, len(LAYOUT.order)))
    joined = Innovations.joined(LAYOUT, raw, measured[:300], lost)
    backends.exact(join_loops)(raw, measured[:300], (5, 7), table, LAYOUT.order)
    assert table.tobytes() == joined.table.tobytes()
    assert measured[:300].tolist() == joined.measured.tolist()


@pytest.mark.parametrize(("kind", "backend"), FILTERS)
def test_a_block_of_nothing_tells_nothing(kind, backend):
    found = observer(kind, backend).follow(np.empty((0, len(FLEA.channels))))
    assert found.table.shape == (0, 29)
    assert len(found.measured) == len(found.diverged) == 0


@pytest.mark.skipif(not HAVE_NUMBA, reason="needs numba")
def test_what_is_compiled_follows_a_change_of_its_parts(tmp_path: Path):
    """A part in another module counts, also where it is named by its module."""
    (tmp_path / "whole.py").write_text("import part\n\ndef whole(x):\n    return part.part(x)\n")
    program = (
        "import part, whole; from flea_diag.core.backend import compiled;"
        "print(compiled(whole.whole, part.part)(2.0))"
    )
    answers = []
    for factor in (3.0, 10.0):
        (tmp_path / "part.py").write_text(f"def part(x):\n    return {factor} * x\n")
        ran = subprocess.run(
            [sys.executable, "-B", "-c", program],
            cwd=tmp_path, check=True, capture_output=True, text=True,
        )  # fmt: skip
        answers.append(float(ran.stdout))
    assert answers == [6.0, 20.0]
