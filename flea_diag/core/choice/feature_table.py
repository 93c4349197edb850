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

"""The fault feature table: the effect of each fault on each feature, with probabilities.

Narasimhan et al. 2010, section 3.3 and Table 3: one row per fault, one column per feature; an
entry is the symbol of the feature against its nominal range. Here an entry may also hold the
probability of each symbol, so that a noisy feature changes odds instead of excluding faults.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt

from flea_diag.core.vibration.nominal_range import NominalRanges
from flea_diag.errors import ConfigurationError, shown
from flea_diag.fields.reader import read_as
from flea_diag.fields.values import FINITE, Share, within
from flea_diag.formats import migrated

Floats = npt.NDArray[np.float64]

UNAFFECTED = "nominal"
"""Name in `window_error` of the faults that act on no feature: their windows are nominal."""

ALPHABETS: tuple[tuple[str, ...], ...] = (
    ("0", "1"),
    ("-", "0", "+"),
    ("--", "-", "0", "+", "++"),
    ("--", "-", "0", "0^", "+", "++"),
)


@dataclass(frozen=True)
class FaultFeatureTable:
    """Fault x feature -> probability of each symbol of ``alphabet``.

    ``costs``: relative CPU times (std of one window = 1) of the features that may be requested;
    other features have entries for use with alarms only. ``provenance``: the source of each
    entry. For a fault without a row every symbol is equally likely, so no feature is evidence
    for or against it. ``window_error``: by the fault that is there and another, the share of
    single windows whose features drop the former for the latter; none where entries are stated,
    not counted. The odds of a window say no more than that: its features depend on each other, and
    their product claims to be surer than it is.
    """

    title: str
    alphabet: tuple[str, ...]
    costs: Mapping[str, float]
    entries: Mapping[tuple[str, str], tuple[float, ...]]
    provenance: Mapping[tuple[str, str], str] = field(default_factory=dict)
    nominal: NominalRanges = field(default_factory=NominalRanges)
    notes: str = ""
    window_error: Mapping[tuple[str, str], float] = field(default_factory=dict)

    @cached_property
    def features(self) -> tuple[str, ...]:
        """Ids of the columns, cheapest first."""
        return tuple(sorted(self.costs, key=lambda feature: (self.costs[feature], feature)))

    @cached_property
    def faults(self) -> tuple[str, ...]:
        """Faults of the rows, in the order of the table."""
        return tuple(dict.fromkeys(fault for fault, _ in self.entries))

    def probabilities(self, fault: str, feature: str) -> tuple[float, ...]:
        """P(symbol | fault) for each symbol of the alphabet."""
        return self.entries.get((fault, feature), (1.0 / len(self.alphabet),) * len(self.alphabet))

    def matrix(self, faults: tuple[str, ...], features: tuple[str, ...]) -> Floats:
        """P(symbol | fault) of several, shape (features, symbols, faults)."""
        rows = [self._columns(fault) for fault in faults]
        places = [self._place_of[feature] for feature in features]
        return np.stack(rows, axis=2)[places]

    @cached_property
    def _place_of(self) -> dict[str, int]:
        return {feature: place for place, feature in enumerate(self.features)}

    def _columns(self, fault: str) -> Floats:
        """P(symbol | fault) of all features, shape (features, symbols); cached."""
        if fault not in self._kept:
            rows = [self.probabilities(fault, feature) for feature in self.features]
            self._kept[fault] = np.array(rows).reshape(len(rows), len(self.alphabet))
        return self._kept[fault]

    @cached_property
    def _kept(self) -> dict[str, Floats]:
        return {}

    def place(self, symbol: str) -> int:
        """Index of a symbol in the alphabet.

        A coarser table reads ``++`` as ``+`` and ``0^`` as ``0``; a table of 0 and 1 reads any
        value outside the range as ``1``.
        """
        if symbol in ("--", "-", "0^", "+", "++") and symbol not in self.alphabet:
            outside = symbol[0] != "0"
            symbol = "1" if outside and "1" in self.alphabet else symbol[0]
        if symbol not in self.alphabet:
            raise ConfigurationError(
                f"symbol {shown(symbol)} is not of the table's alphabet {' '.join(self.alphabet)}"
            )
        return self.alphabet.index(symbol)

    def value(self, fault: str, feature: str) -> str:
        """Most probable symbol; ``?`` if the table has no entry."""
        entry = self.entries.get((fault, feature))
        return self.alphabet[entry.index(max(entry))] if entry else "?"

    def of_vibration(self) -> FaultFeatureTable:
        """The same without features of the scans, for use with likelihoods of the scans."""
        return self._of_vibration

    @cached_property
    def _of_vibration(self) -> FaultFeatureTable:
        costs = {f: cost for f, cost in self.costs.items() if f.startswith("accelerometer")}
        return replace(self, costs=costs)

    @cached_property
    def plans(self) -> dict[Hashable, Any]:
        """Cache of plans made with this table; they depend on nothing else."""
        return {}

    def inseparable(self, faults: Iterable[str]) -> tuple[tuple[str, ...], ...]:
        """Groups of faults with equal symbols in every column: no tree can split them."""
        groups: dict[tuple[str, ...], list[str]] = {}
        for fault in faults:
            row = tuple(self.value(fault, feature) for feature in self.features)
            groups.setdefault(row, []).append(fault)
        return tuple(tuple(group) for group in groups.values())

    @classmethod
    def from_mapping(cls, content: object, where: str) -> FaultFeatureTable:
        """Table from parsed YAML.

        Raises
        ------
        ConfigurationError
            An entry is invalid; the message names file, fault, feature and value.
        """
        known = read_as(
            _TableFile, migrated("feature table", content, where), where, magnitudes=FINITE
        )
        alphabet = tuple(map(str, known.alphabet))
        if alphabet not in ALPHABETS:
            raise ConfigurationError(
                f"{where}: alphabet {shown(alphabet)} is unknown, choose [0, 1], [-, 0, +], "
                "[--, -, 0, +, ++] or [--, -, 0, 0^, +, ++]"
            )
        for key in ("features", "faults"):
            if not getattr(known, key):
                raise ConfigurationError(f"{where}: {key} is empty; give at least one")
        common = {"source": known.unaffected.source, **known.unaffected.entries}
        rows = {**known.faults, **dict.fromkeys(known.unaffected.faults, common)}
        entries, sources = _entries(rows, tuple(known.features), alphabet, known.confidence, where)
        costs = {name: row.cost for name, row in known.features.items() if row.asked}
        _check(known.nominal, costs, f"{where}: nominal")
        return cls(
            known.title or where, alphabet, costs, entries, sources, known.nominal,
            known.provenance, _window_error(known, frozenset(rows), where),
        )  # fmt: skip


@dataclass(frozen=True)
class _Feature:
    """One column."""

    cost: Annotated[float, within(1e-3, 1e6)]
    note: str = ""
    asked: bool = True


@dataclass(frozen=True)
class _Unaffected:
    """Faults that share one row of entries."""

    source: str = ""
    faults: tuple[str, ...] = ()
    entries: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class _TableFile:
    """The whole file; an entry may be a symbol, or a mapping of probabilities."""

    features: Mapping[str, _Feature]
    faults: Mapping[str, Mapping[str, Any]]
    title: str = ""
    provenance: str = ""
    window_error: Mapping[str, Mapping[str, Share]] = field(default_factory=dict)
    alphabet: tuple[Any, ...] = ("-", "0", "+")
    confidence: Share = 1.0
    unaffected: _Unaffected = field(default_factory=_Unaffected)
    nominal: NominalRanges = field(default_factory=NominalRanges)


def _window_error(
    known: _TableFile, rows: frozenset[str], where: str
) -> dict[tuple[str, str], float]:
    """Errors by pairs of faults; what the file says of `UNAFFECTED` holds for each of them."""
    alike = {fault: (fault,) for fault in rows} | {UNAFFECTED: known.unaffected.faults}
    _known(known.window_error, frozenset(alike), f"{where}: window_error")
    found: dict[tuple[str, str], float] = {}
    for there, row in known.window_error.items():
        _known(row, frozenset(alike), f"{where}: window_error: {there}")
        for other, share in row.items():
            found |= dict.fromkeys(product(alike[there], alike[other]), share)
    return found


def _check(nominal: NominalRanges, costs: Mapping[str, float], where: str) -> None:
    _known(nominal.ranges, frozenset(costs), f"{where}: ranges")
    for key in ("ranges", "levels", "resting_levels", "kurtosis"):
        for name, row in getattr(nominal, key).items():
            if wrong := row.contradiction():
                raise ConfigurationError(f"{where}: {key}: {shown(name)}: {wrong}")


def _entries(
    rows: Mapping[str, Mapping[str, Any]],
    features: tuple[str, ...],
    alphabet: tuple[str, ...],
    confidence: float,
    where: str,
) -> tuple[dict[tuple[str, str], tuple[float, ...]], dict[tuple[str, str], str]]:
    """Probabilities and sources of all entries; a row that faults share is read once."""
    entries: dict[tuple[str, str], tuple[float, ...]] = {}
    provenance: dict[tuple[str, str], str] = {}
    known: dict[int, dict[str, tuple[tuple[float, ...], str]]] = {}
    for fault, row in rows.items():
        if id(row) not in known:
            known[id(row)] = _row(row, features, alphabet, confidence, f"{where}: {fault}")
        for feature, (numbers, source) in known[id(row)].items():
            entries[fault, feature], provenance[fault, feature] = numbers, source
    return entries, provenance


def _row(
    row: Mapping[str, Any],
    features: tuple[str, ...],
    alphabet: tuple[str, ...],
    confidence: float,
    where: str,
) -> dict[str, tuple[tuple[float, ...], str]]:
    """Probabilities and source of each entry; ``source`` of a row applies to its entries."""
    _known(row, frozenset({"source", *features}), where)
    source = str(row.get("source", ""))
    made = {}
    for feature in features:
        entry = row.get(feature)
        if entry is None:
            continue
        own = dict(entry) if isinstance(entry, Mapping) else entry
        from_ = str(own.pop("source", source)) if isinstance(own, dict) else source
        made[feature] = _probabilities(own, alphabet, confidence, f"{where}, {feature}"), from_
    return made


def _probabilities(
    entry: Any, alphabet: tuple[str, ...], confidence: float, where: str
) -> tuple[float, ...]:
    """Probability of each symbol: given one by one, or one symbol with the confidence."""
    if isinstance(entry, Mapping):
        given = {str(symbol): value for symbol, value in entry.items()}
        _known(given, frozenset(alphabet), where)
        read = read_as(dict[str, Share], given, where, magnitudes=FINITE)
        numbers = tuple(read.get(symbol, 0.0) for symbol in alphabet)
        if abs(sum(numbers) - 1.0) > 0.01:
            raise ConfigurationError(f"{where}: probabilities sum to {sum(numbers):g}, must be 1")
        return tuple(number / sum(numbers) for number in numbers)
    if str(entry) not in alphabet:
        raise ConfigurationError(f"{where}: {shown(entry)} is not one of {' '.join(alphabet)}")
    rest = (1.0 - confidence) / (len(alphabet) - 1)
    return tuple(confidence if symbol == str(entry) else rest for symbol in alphabet)


def _known(mapping: Mapping[str, Any], known: frozenset[str], where: str) -> None:
    unknown = sorted(str(key) for key in mapping if str(key) not in known)
    if unknown:
        raise ConfigurationError(
            f"{where}: unknown key {shown(unknown[0])}, known are {', '.join(sorted(known))}"
        )
