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

"""What holds between the files of a stand, checked once before any command works with them.

A description may be read and still be of no use to a later step: an operating point that cannot be
held, a fault that moves nothing, a friction without a width. So every command asks for the whole
chain first, and all of them say the same line. The answer is kept: it costs half a second.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from flea_diag.configuration.description import (
    compiled_relations,
    described,
    effects_of,
    require_relations,
)
from flea_diag.configuration.disk_cache import kept
from flea_diag.configuration.files import found_file, text_of
from flea_diag.configuration.stand import Stand
from flea_diag.core.bond_graph.actuator import Actuator
from flea_diag.core.causal_graph.operating_point import QUADRANTS, operating_values
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.core.signatures.signature import SPEEDS
from flea_diag.errors import ConfigurationError, shown

WIDTH = "stribeck_speed_m_s"
HEATING = "thermal_rate_k_per_s"


def require_accepted(stand: Stand) -> None:
    """Refuse a stand whose description or catalogue a later step would refuse.

    Raises
    ------
    ConfigurationError
        Names the file, the entry that is wrong or missing, and the remedy.
    ModelError
        The sensors, or the operating point, do not determine what is asked of them.
    """
    texts = tuple(text_of(found_file(path)) for path in (stand.actuator, stand.faults))

    def checked() -> bool:
        require_usable(stand.actuator)
        known = compiled_relations(stand.actuator)
        effects_of(stand.actuator, stand.faults, known, tuple(described(stand.actuator).sensors))
        return True

    kept("accepted", texts, checked)


def require_usable(actuator: Path) -> None:
    """The same of a description alone."""
    require_relations(actuator)
    model, known = described(actuator), compiled_relations(actuator)
    for wrong in _contradictions(model, known):
        raise ConfigurationError(f"{actuator}: {wrong}")
    for quadrant in QUADRANTS:
        for share in SPEEDS:
            operating_values(model, quadrant, speed=share)


def _contradictions(model: Actuator, known: RelationSet) -> Iterator[str]:
    if WIDTH not in model.base_parameters:
        yield (
            f"base_parameters has no {WIDTH}, the width of the smooth sign of friction, which says "
            "what is motion; name the product that it is"
        )
    if not known.residuals.friction:
        yield (
            "no balance with the friction of a motion is closed by its sensors, so nothing tells "
            "what is healthy motion; name one under residuals, and the sensors that close it"
        )
    if known.predictions and HEATING not in model.tolerances:
        names = ", ".join(row.name for row in known.predictions)
        yield (
            f"{names} {'is' if len(known.predictions) == 1 else 'are'} predicted, and tolerances "
            f"has no {HEATING}, by which the heating of a healthy unit departs from that; add it"
        )
    unread = [n for n in model.predicted.values() if n not in {p.name for p in known.predictions}]
    for name in unread:
        yield (
            f"predicted: {shown(name)} is no residual of kind prediction that the sensors close; "
            "name one"
        )
