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

"""What screens draw of a stand: its causal graph, and the diagnosis tree of a group."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from flea_diag.configuration.description import described
from flea_diag.configuration.knowledge import load_features
from flea_diag.core.choice.diagnosis_tree import Node, asked_tree
from flea_diag.core.choice.feature_choice import FeatureChooser
from flea_diag.core.drawing.causal_map import CausalMap, causal_map

Planner = Callable[..., Node]
"""``asked_tree`` with a bound chooser: (group, asked, rarest) -> Node."""


def load_causal_map(actuator: str | Path) -> CausalMap:
    """Causal graph of an actuator with its layout, for a screen."""
    return causal_map(described(actuator))


def tree_planner(features: str | Path) -> Planner:
    """Function that plans the diagnosis tree of a group, given the features requested so far."""
    chooser = FeatureChooser(load_features(features).of_vibration())
    return partial(asked_tree, chooser=chooser)
