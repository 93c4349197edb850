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

"""A description as it grows, part by part."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np


@dataclass
class Draft:
    """A description as it grows."""

    rng: np.random.Generator
    parameters: dict[str, dict[str, Any]] = field(default_factory=dict)
    junctions: dict[str, dict[str, str]] = field(default_factory=dict)
    elements: dict[str, dict[str, Any]] = field(default_factory=dict)
    bonds: list[str] = field(default_factory=list)
    sensors: dict[str, dict[str, Any]] = field(default_factory=dict)
    inputs: dict[str, dict[str, Any]] = field(default_factory=dict)
    residuals: dict[str, dict[str, Any]] = field(default_factory=dict)
    base: dict[str, str] = field(default_factory=dict)
    fixed: dict[str, float] = field(default_factory=dict)
    predicted: dict[str, str] = field(default_factory=dict)

    def may(self, share: float = 0.5) -> bool:
        """A draw."""
        return bool(self.rng.random() < share)

    def one_of(self, *choices: Any) -> Any:
        """One of these."""
        return choices[int(self.rng.integers(len(choices)))]

    def parameter(self, name: str, value: float, unit: str) -> str:
        """A parameter near this value."""
        drawn = value * float(np.exp(self.rng.normal(0.0, 0.3)))
        self.parameters[name] = {"value": float(f"{drawn:.4g}"), "unit": unit}
        return name

    def constant(self, name: str, value: float, unit: str) -> str:
        """A parameter of this value."""
        self.parameters[name] = {"value": value, "unit": unit}
        return name

    def junction(self, name: str, kind: str, domain: str) -> None:
        """A junction."""
        self.junctions[name] = {"type": kind, "domain": domain}

    def element(self, name: str, at: str, *, source: bool = False, **row: Any) -> None:
        """An element at a junction."""
        self.elements[name] = row
        self.bonds.append(f"{name} -> {at}" if source else f"{at} -> {name}")
