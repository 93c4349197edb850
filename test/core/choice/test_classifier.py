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

"""The classifier: the same answers as the library that trained it, and files that cannot run."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from flea_diag.core.choice.classifier import Perceptron, scaled, standardised
from flea_diag.core.choice.feature_learning import Sample
from flea_diag.core.vibration.nominal_range import VibrationOperatingPoint
from flea_diag.errors import CalibrationError, ConfigurationError
from flea_diag.tools.features.classifier import (
    HIDDEN,
    MOST_EPOCHS,
    SEED,
    Called,
    call,
    call_report,
    read_classifier,
    train,
    write_classifier,
)
from flea_diag.tools.features.samples import FeatureRun

FEATURES = ["level", "shape"]
CENTRES = {"nominal": (1.0, 3.0), "jam": (3.0, 3.0), "spall": (3.0, 9.0)}


def samples(names: tuple[str, ...] = tuple(CENTRES), count: int = 120) -> list[Sample]:
    draw = np.random.default_rng(3)
    return [
        Sample(name, VibrationOperatingPoint(80.0, 50.0), dict(zip(FEATURES, row, strict=True)))
        for name in names
        for row in np.exp(0.1 * draw.standard_normal((count, 2))) * CENTRES[name]
    ]


@pytest.mark.slow
@pytest.mark.parametrize("names", [tuple(CENTRES), ("jam", "spall")])
def test_network_gives_the_probabilities_of_scikit_learn(names: tuple[str, ...]) -> None:
    sklearn = pytest.importorskip("sklearn.neural_network", reason="needs scikit-learn")
    learned = train(samples(names), FEATURES, "test")
    rows = samples(names, 20)
    inputs = standardised(
        scaled([s.values for s in samples(names)], FEATURES), learned.means, learned.scales
    )
    other = sklearn.MLPClassifier(HIDDEN, alpha=1e-2, max_iter=MOST_EPOCHS, random_state=SEED).fit(
        inputs, [s.fault for s in samples(names)]
    )
    asked = standardised(scaled([s.values for s in rows], FEATURES), learned.means, learned.scales)
    for sample, wanted in zip(rows, other.predict_proba(asked), strict=True):
        found = learned.probabilities(sample.values)
        np.testing.assert_allclose([found[name] for name in other.classes_], wanted, atol=1e-9)


def test_what_was_learned_is_called_right_and_survives_its_file(tmp_path: Path) -> None:
    pytest.importorskip("sklearn", reason="needs scikit-learn")
    path = tmp_path / "classifier.json"
    write_classifier(path, train(samples(), FEATURES, "made up"))
    network = read_classifier(path)
    assert network.source == "made up"
    runs = [FeatureRun(s.fault, 2e4, (s, s)) for s in samples(count=20) if s.fault != "nominal"]
    called = call(runs, network, ("jam", "spall"), windows=2)
    assert len(called) == 40
    assert all(row.right for row in called)


TINY = Perceptron(
    ("level",), ("jam", "spall"), np.zeros(1), np.ones(1),
    ((np.array([[1.0]]), np.array([0.0])), (np.array([[2.0, 0.0]]), np.array([0.0, 1.0]))),
)  # fmt: skip


def test_a_network_worked_on_paper() -> None:
    """ln(1 + 100 * 0.01718...) = 1: hidden 1, outputs 2 and 1."""
    found = TINY.probabilities({"level": (math.e - 1.0) / 100.0})
    assert found["jam"] == pytest.approx(math.e / (1.0 + math.e))
    # Missing counts as average: hidden 0, outputs 0 and 1.
    assert TINY.probabilities({})["spall"] == pytest.approx(math.e / (1.0 + math.e))
    assert sum(TINY.probabilities({"level": math.inf}).values()) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"layers": []}, "do not lead from 1 features to 2 faults"),
        ({"faults": ["jam"]}, "do not lead"),
        ({"scales": [0.0]}, r"scales\[0\] = 0.0 must be above 0"),
        ({"scales": [1.0, 1.0]}, "must have 1 entries"),
        ({"means": [math.nan]}, r"means\[0\] = nan must be a finite number"),
        ({"means": "many"}, "means = 'many' must be a list"),
        ({"layers": [{"weights": [[1.0], [2.0]], "offsets": [0.0]}]}, "must have 1 rows"),
        ({"extra": 1}, "unknown key 'extra'"),
    ],
)
def test_a_file_that_does_not_fit_is_refused(change: dict[str, object], words: str) -> None:
    with pytest.raises(ConfigurationError, match=words) as refusal:
        Perceptron.from_mapping({**TINY.as_mapping(), **change}, "c.json")
    assert str(refusal.value).startswith("c.json")


def test_foreign_files_are_refused_by_name(tmp_path: Path) -> None:
    path = tmp_path / "foreign.json"
    with pytest.raises(ConfigurationError, match=r"foreign\.json: cannot be read"):
        read_classifier(path)
    path.write_bytes(b"\x80\x04\x95")  # how a pickle begins
    with pytest.raises(ConfigurationError, match=r"foreign\.json: not a text file"):
        read_classifier(path)
    path.write_text("{")
    with pytest.raises(ConfigurationError, match=r"foreign\.json: not valid JSON"):
        read_classifier(path)
    path.write_text(json.dumps([1, 2]))
    with pytest.raises(ConfigurationError, match=r"foreign\.json: classifier must be a mapping"):
        read_classifier(path)
    path.write_text(json.dumps({"schema_version": 1, "features": []}))
    with pytest.raises(ConfigurationError, match=r"foreign\.json: source is missing"):
        read_classifier(path)


def test_one_class_is_nothing_to_learn_from() -> None:
    pytest.importorskip("sklearn", reason="needs scikit-learn")
    with pytest.raises(CalibrationError, match="needs two"):
        train(samples(("jam",)), FEATURES, "test")


def test_report_counts_right_answers() -> None:
    rows = [Called("jam", "jam", 0.9, 0.0), Called("jam", "spall", 0.7, 0.0)]
    assert call_report(rows).splitlines()[1].split()[:3] == ["jam", "2", "0.500"]
    assert call_report([]).endswith("no runs")
