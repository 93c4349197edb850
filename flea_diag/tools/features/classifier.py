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

"""Training and scoring of the feature-only classifier, for comparison with a feature table."""

from __future__ import annotations

import json
import math
import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from flea_diag.core.choice.classifier import Perceptron, scaled, standardised
from flea_diag.core.choice.feature_learning import Sample
from flea_diag.errors import CalibrationError, ConfigurationError
from flea_diag.tools.extra import require
from flea_diag.tools.features.samples import FeatureRun
from flea_diag.tools.interval import wilson
from flea_diag.tools.terminal import write_text
from flea_diag.wire.json_text import parse_json
from flea_diag.wire.regular_file import read_text

HIDDEN = (32, 16)
SEED = 7
MOST_EPOCHS = 300
LARGEST_BYTES = 16 << 20
MOST_NUMBERS = 500_000


def train(samples: Sequence[Sample], features: Sequence[str], source: str) -> Perceptron:
    """Train a small network on all features of all windows in motion; nominal is a class.

    Raises
    ------
    ConfigurationError
        scikit-learn is not installed.
    CalibrationError
        There are fewer than two classes.
    """
    require("classifier", "training a classifier")
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.neural_network import MLPClassifier

    moving = [sample for sample in samples if sample.moving]
    labels = [sample.fault for sample in moving]
    if len(set(labels)) < 2:
        raise CalibrationError(
            f"{len(set(labels))} class of windows: a classifier needs two or more"
        )
    values = scaled([sample.values for sample in moving], features)
    known = np.isfinite(values).any(axis=0)
    features = [name for name, keep in zip(features, known, strict=True) if keep]
    values = values[:, known]
    means, scales = np.nanmean(values, axis=0), np.nanstd(values, axis=0)
    scales = np.where(scales > 0.0, scales, 1.0)
    network = MLPClassifier(HIDDEN, alpha=1e-2, max_iter=MOST_EPOCHS, random_state=SEED)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        network.fit(standardised(values, means, scales), labels)
    layers = list(zip(network.coefs_, network.intercepts_, strict=True))
    if len(network.classes_) == 2:  # scikit-learn has a single output for two classes
        weights, offsets = layers[-1]
        layers[-1] = np.hstack([0.0 * weights, weights]), np.hstack([0.0 * offsets, offsets])
    names = tuple(map(str, network.classes_))
    return Perceptron(tuple(features), names, means, scales, tuple(layers), source)


def write_classifier(path: Path, network: Perceptron) -> None:
    """Write a network as JSON.

    Raises
    ------
    ConfigurationError
        The file cannot be written.
    """
    write_text(path, json.dumps(network.as_mapping()) + "\n")


def read_classifier(path: Path) -> Perceptron:
    """Read a network.

    Raises
    ------
    ConfigurationError
        The file cannot be read, is not JSON, or does not contain a network.
    """
    try:
        mapping = parse_json(
            read_text(path, LARGEST_BYTES, ConfigurationError),
            largest=LARGEST_BYTES,
            most_values=MOST_NUMBERS,
        )
    except OSError as error:
        raise ConfigurationError(f"{path}: cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise ConfigurationError(f"{path}: {error}") from None
    return Perceptron.from_mapping(mapping, str(path))


@dataclass(frozen=True)
class Called:
    """Answer of the classifier for one run, and its CPU time without the features."""

    truth: str
    called: str
    probability: float
    cpu_s: float

    @property
    def right(self) -> bool:
        """Whether the most probable class is the truth."""
        return self.called == self.truth


def call(
    runs: Sequence[FeatureRun], classifier: Perceptron, group: Sequence[str], windows: int
) -> list[Called]:
    """One answer per run with a fault of the group, from as many windows as a walk may use.

    Windows are treated as independent: log-probabilities are added. Only classes of the group
    are considered, as in a walk.
    """
    called: list[Called] = []
    for run in runs:
        samples = run.asked(group, windows)
        if samples:
            called.append(_call(samples, classifier, group))
    return called


def _call(samples: Sequence[Sample], classifier: Perceptron, group: Sequence[str]) -> Called:
    begin = time.process_time_ns()
    evidence = dict.fromkeys(group, 0.0)
    for sample in samples:
        found = classifier.probabilities(sample.values)
        for fault in group:
            evidence[fault] += math.log(max(found.get(fault, 0.0), 1e-12))
    best = max(evidence, key=evidence.__getitem__)
    total = math.fsum(math.exp(value - evidence[best]) for value in evidence.values())
    spent = (time.process_time_ns() - begin) / 1e9
    return Called(samples[0].fault, best, 1.0 / total, spent)


def call_report(called: Sequence[Called]) -> str:
    """Table of correctly classified runs by fault."""
    lines = [f"{'fault':24s}{'n':>5s}{'right':>10s}{'95 %':>17s}{'sure':>7s}"]
    names = [*dict.fromkeys(row.truth for row in called), ""]
    for name in names if called else ():
        rows = [row for row in called if not name or row.truth == name]
        hits, n = sum(row.right for row in rows), len(rows)
        low, high = wilson(hits, n)
        sure = sum(row.probability for row in rows) / n
        interval = f"{low:.3f} to {high:.3f}"
        lines.append(f"{name or 'all':24s}{n:5d}{hits / n:10.3f}{interval:>17s}{sure:7.3f}")
    return "\n".join(lines if called else [*lines, "no runs"])
