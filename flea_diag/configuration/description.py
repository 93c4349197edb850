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

"""The description of an actuator, and what is derived from it: relations and signatures."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

from flea_diag.configuration import signature_entry
from flea_diag.configuration.disk_cache import kept
from flea_diag.configuration.files import found_file, load_yaml, parsed, text_of
from flea_diag.configuration.generated_file import source_file
from flea_diag.core.bond_graph.actuator import Actuator
from flea_diag.core.bond_graph.actuator import actuator as read_actuator
from flea_diag.core.causal_graph.operating_point import QUADRANTS, Quadrant
from flea_diag.core.faults.fault import Fault, catalogue, of_sensors
from flea_diag.core.likelihood.effect_set import EffectSet, effect_set
from flea_diag.core.residuals.parameters import LEAD, STANDARD, UNIT_PARAMETERS
from flea_diag.core.residuals.parity import parity_relation
from flea_diag.core.residuals.relation_compiler import relation_set
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.core.residuals.residual_set import (
    encoder_of,
    relation_names,
    residual_set,
)
from flea_diag.core.signatures.diagnosability import usable_residuals
from flea_diag.core.signatures.signature import SignatureTable, signature_table
from flea_diag.core.symbolic.generated import keep_with
from flea_diag.errors import ConfigurationError, ModelError, shown
from flea_diag.formats import migrated

keep_with(source_file)


def described(actuator: str | Path) -> Actuator:
    """Actuator of a description; cached, for a start needs it several times."""
    return _described(*_read(actuator))


def description_sha256(actuator: str | Path) -> str:
    """Digest of the content of a description, independent of layout and comments."""
    return _sha256(*_read(actuator))


def compiled_relations(
    actuator: str | Path, channels: tuple[str, ...] | None = None, has_encoder: bool = True
) -> RelationSet:
    """Relations of the description that these channels close, of all its sensors by default.

    The speed comes from the encoder, or without one whose lead is known from the position.
    """
    return _compiled(*_read(actuator), channels, has_encoder)


def require_relations(actuator: str | Path) -> None:
    """Refuse a description whose sensors close none of its relations.

    Raises
    ------
    ConfigurationError
        Names the file, the junction and what is not measured there.
    """
    if compiled_relations(actuator).relations:
        return
    model, why = described(actuator), "none is named under residuals"
    try:
        for name in relation_names(model):
            parity_relation(model, model.residuals[name])
    except ModelError as error:
        why = str(error)
    raise ConfigurationError(f"{actuator}: its sensors close no relation: {why}")


def faults_of(actuator: str | Path, faults: str | Path) -> Mapping[str, Fault]:
    """Fault catalogue for all sensors of a description."""
    return catalogue(load_yaml(faults), described(actuator), str(faults))


def effects_of(
    actuator: str | Path, faults: str | Path, known: RelationSet, channels: tuple[str, ...]
) -> EffectSet:
    """Effects of the catalogue on these relations, for a stand with these channels.

    Raises
    ------
    ConfigurationError
        A fault moves no relation, whatever sensors there were.
    """
    return _effects(_read(actuator), _read(faults), known, channels)


def signatures(
    actuator: str | Path, faults: str | Path, channels: tuple[str, ...], period_s: float
) -> tuple[Mapping[str, Fault], Mapping[Quadrant, SignatureTable]]:
    """Catalogue and signature tables for these channels; cached, takes about 1 s."""
    return _signatures(_read(actuator), _read(faults), channels, period_s)


class _Text(NamedTuple):
    """Text of a file: what is made of it is kept until the text is another."""

    path: Path
    text: str


def _read(name_or_path: str | Path) -> _Text:
    path = found_file(name_or_path)
    return _Text(path, text_of(path))


@lru_cache(maxsize=8)
def _described(path: Path, text: str) -> Actuator:
    return read_actuator(parsed(text, path), str(path))


@lru_cache(maxsize=8)
def _sha256(path: Path, text: str) -> str:
    content = migrated("actuator description", parsed(text, path), str(path))
    line = json.dumps(content, sort_keys=True, separators=(",", ":"), default=str)
    return hashlib.sha256(line.encode()).hexdigest()


@lru_cache(maxsize=8)
def _compiled(
    path: Path, text: str, channels: tuple[str, ...] | None, has_encoder: bool
) -> RelationSet:
    model = _described(path, text)
    known = [name for name in model.sensors if channels is None or name in channels]
    fitted = [name for name in known if has_encoder or name != encoder_of(model)]
    # Without an encoder nothing tells its lead, which a calibration then holds as 0.
    lead = () if has_encoder else (LEAD,)
    held = [name for name in dict.fromkeys((*STANDARD, *model.fitted)) if name not in lead]
    every = None if channels is None else _compiled(path, text, None, has_encoder)
    unread = {name for name in model.inputs if channels is not None and name not in channels}
    names, fit = relation_names(model), model.with_sensors(fitted)
    made = relation_set(fit, names, held, UNIT_PARAMETERS, unread)
    whole = None if channels is None and has_encoder else _compiled(path, text, None, True)
    residuals = residual_set(model, made) if whole is None else whole.residuals
    used = {*STANDARD, *(every or made).parameters}
    values = (whole or made).described
    stated = {name: value for name, value in values.items() if name in used}
    return replace(made, every=every, residuals=residuals, described=stated)


@lru_cache(maxsize=8)
def _catalogue(actuator: _Text, faults: _Text, channels: tuple[str, ...]) -> Mapping[str, Fault]:
    """Catalogue without the faults of sensors that a stand does not have."""
    rows = catalogue(parsed(faults.text, faults.path), _described(*actuator), str(faults.path))
    return MappingProxyType(of_sensors(rows, channels))


@lru_cache(maxsize=8)
def _effects(
    actuator: _Text, faults: _Text, known: RelationSet, channels: tuple[str, ...]
) -> EffectSet:
    rows = _catalogue(actuator, faults, channels)
    made = effect_set(known, rows.values())
    silent = {n: row for n, row in rows.items() if row.effects and n not in made.faults}
    felt = effect_set(known.every or known, silent.values()).faults if silent else frozenset()
    for name in silent:
        if name not in felt:
            raise ConfigurationError(
                f"{faults.path}: fault {shown(name)}: what its effects change is in no relation of "
                f"{actuator.path}; name parameters of a relation (flea model equations prints "
                "them), or leave effects out"
            )
    return made


@lru_cache(maxsize=8)
def _signatures(
    actuator: _Text, faults: _Text, channels: tuple[str, ...], period_s: float
) -> tuple[Mapping[str, Fault], Mapping[Quadrant, SignatureTable]]:
    whole = _described(*actuator)
    model = whole.with_sensors([name for name in channels if name in whole.sensors])
    rows = _catalogue(actuator, faults, channels)
    names = usable_residuals(model)

    def derived() -> dict[str, Any]:
        made = (signature_table(model, rows, names, q, period_s) for q in QUADRANTS)
        return signature_entry.plain(tuple(made))

    inputs = (actuator.text, faults.text, *channels, repr(period_s))
    content = kept("signatures", inputs, derived)
    tables = signature_entry.tables(content, QUADRANTS, rows, names, period_s)
    return rows, MappingProxyType(tables)
