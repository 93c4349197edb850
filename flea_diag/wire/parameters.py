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

"""Parameters as frozen dataclasses: default, unit, bounds and description in one place.

ROS parameters, YAML files and ``--help`` are generated from the same fields. A class is
written ``@dataclass(frozen=True) class P: rate_hz: float = parameter(100.0, "...", unit="Hz",
minimum=1.0, maximum=1000.0)``.
"""

from __future__ import annotations

from dataclasses import MISSING, Field, dataclass, field, fields
from typing import Any, TypeVar

from flea_diag.fields.reader import read_as
from flea_diag.fields.values import FINITE

P = TypeVar("P")
Value = Any


@dataclass(frozen=True)
class Descriptor:
    """Description of one parameter, without its value."""

    name: str
    kind: type
    default: Value
    doc: str
    unit: str
    minimum: float | None
    maximum: float | None
    choices: tuple[str, ...]
    read_only: bool


def parameter(
    default: Value,
    doc: str,
    *,
    unit: str = "",
    minimum: float | None = None,
    maximum: float | None = None,
    choices: tuple[str, ...] = (),
    read_only: bool = False,
) -> Any:
    """A dataclass field with unit, bounds and description."""
    return field(
        default=default,
        metadata={
            "doc": doc,
            "unit": unit,
            "minimum": minimum,
            "maximum": maximum,
            "choices": choices,
            "read_only": read_only,
        },
    )


def descriptors(parameters: type) -> tuple[Descriptor, ...]:
    """Descriptors of all parameters of a class, in order; other fields are skipped."""
    return tuple(_descriptor(entry) for entry in fields(parameters) if "doc" in entry.metadata)


def _descriptor(entry: Field[Any]) -> Descriptor:
    if entry.default is MISSING:
        raise TypeError(f"parameter {entry.name} has no default")
    return Descriptor(entry.name, type(entry.default), entry.default, **entry.metadata)


def build(parameters: type[P], values: object, where: str) -> P:
    """Parameter object from a mapping; unknown keys and invalid values are refused by name.

    A float must be finite. The one exception is NaN as its own default, which means "not given".

    Raises
    ------
    ConfigurationError
        Names the parameter, the value, the limit and the source of the value.
    """
    return read_as(parameters, values, where, magnitudes=FINITE)
