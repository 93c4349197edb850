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

"""What an error of the current does by turning its sign."""

from __future__ import annotations

import numpy as np
import pytest

from flea_diag.configuration.calibrations import law_of, learned
from flea_diag.configuration.evidence import stream_hypotheses
from flea_diag.configuration.knowledge import effects
from flea_diag.configuration.stand import load_stand
from flea_diag.core.evidence.hypotheses import StreamHypotheses
from flea_diag.core.evidence.stream_windows import LawWindow

DRIVE, CIRCUIT = "parity_drive", "parity_electrical"


def hypotheses(name: str) -> StreamHypotheses:
    """Of any unit of a stand."""
    stand = load_stand(name)
    calibration = learned(stand)
    known = effects(stand, calibration)
    return stream_hypotheses(stand, calibration, known, law_of(stand))[1]


def turned_v(of: StreamHypotheses, read_a: float, error_a: float) -> float:
    """What a full turn adds to the drive, V, where the circuit alone tells of an error."""
    assert of.way is not None
    relations, signals = of.columns.relations, of.columns.design.shape[1]
    window = np.zeros((len(relations), signals))
    window[:, of.way.current] = read_a
    left = np.zeros(len(relations))
    left[relations.index(CIRCUIT)] = of.way.gain * error_a
    motion, stands = np.zeros(5), False
    said = LawWindow(np.zeros(len(relations)), window, window, motion, stands)
    law = of.columns.design @ of.mean
    return float(of.way.added(said, left, np.ones(len(relations)), law)[relations.index(DRIVE)])


def test_an_error_adds_to_the_bridge_where_it_turns_the_current_alone() -> None:
    """The law of the FLEA has 0.2 V by the way of the current, which no relation holds."""
    of = hypotheses("")
    drop_v = of.mean[of.columns.names.index(f"{DRIVE}: current_way")]
    assert turned_v(of, 0.3, 0.6) == pytest.approx(-2.0 * drop_v)
    assert turned_v(of, -0.3, -0.6) == pytest.approx(2.0 * drop_v)
    assert turned_v(of, 0.3, 0.2) == turned_v(of, 0.3, -0.6) == 0.0


def test_a_bridge_that_is_named_turns_with_what_its_relation_holds() -> None:
    """Nearly twice its drop of 0.6 V, at a current at which a small one is as good as its sign."""
    of = hypotheses("ema")
    assert turned_v(of, 2.0, 4.0) == pytest.approx(turned_v(of, 1.5, 3.0), rel=0.01)
    assert abs(turned_v(of, 2.0, 4.0)) > 0.1


def test_the_errors_of_the_current_alone_have_a_turn() -> None:
    """In no place of a size of theirs, and between none of it and all."""
    of = hypotheses("")
    models, (_, sizes) = of.signatures.models, of.signatures.shape
    having = {int(place) // sizes: int(place) % sizes for place in of.signatures.turns}
    assert {models[k].channel for k in having} == {"motor_current"}
    assert all(place == len(models[k].sizes) for k, place in having.items())
    low, high = of.signatures.prior.low.ravel(), of.signatures.prior.high.ravel()
    assert set(low[of.signatures.turns]) == {0.0}
    assert set(high[of.signatures.turns]) == {1.0}
