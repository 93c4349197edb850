"""The fault feature table: the effect of each fault on each feature, with probabilities.

Narasimhan et al. 2010, section 3.3 and Table 3: one row per fault, one column per feature; an
entry is the symbol of the feature against its nominal range. Here an entry may also hold the
probability of each symbol, so that a noisy feature changes odds instead of excluding faults.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from flea_diag.core.vibration.nominal_range import NominalRange, NominalRanges
from flea_diag.errors import ConfigurationError, shown
from flea_diag.formats import migrated

Floats = npt.NDArray[np.float64]

ALPHABETS: tuple[tuple[str, ...], ...] = (
    ("0", "1"),
    ("-", "0", "+"),
    ("--", "-", "0", "+", "++"),
    ("--", "-", "0", "0^", "+", "++"),
)
KEYS = frozenset(
    {
        "title",
        "provenance",
        "alphabet",
        "confidence",
        "features",
        "faults",
        "unaffected",
        "nominal",
    }
)
FEATURE_KEYS = frozenset({"cost", "note", "asked"})
NOMINAL_KEYS = frozenset(
    {
        "rate_hz",
        "window_s",
        "false_alarm_rate",
        "ranges",
        "levels",
        "resting_levels",
        "kurtosis",
        "orders",
    }
)


@dataclass(frozen=True)
class FaultFeatureTable:
    """Fault x feature -> probability of each symbol of ``alphabet``.

    ``costs``: relative CPU times (std of one window = 1) of the features that may be requested;
    other features have entries for use with alarms only. ``provenance``: the source of each
    entry. For a fault without a row every symbol is equally likely, so no feature is evidence
    for or against it.
    """

    title: str
    alphabet: tuple[str, ...]
    costs: Mapping[str, float]
    entries: Mapping[tuple[str, str], tuple[float, ...]]
    provenance: Mapping[tuple[str, str], str] = field(default_factory=dict)
    nominal: NominalRanges = field(default_factory=NominalRanges)
    notes: str = ""

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
        mapping = migrated("feature table", content, where)
        _known(_mapping(mapping, where), KEYS, where)
        alphabet = tuple(str(symbol) for symbol in mapping.get("alphabet", ("-", "0", "+")))
        if alphabet not in ALPHABETS:
            raise ConfigurationError(
                f"{where}: alphabet {shown(alphabet)} is unknown, choose [0, 1], [-, 0, +], "
                "[--, -, 0, +, ++] or [--, -, 0, 0^, +, ++]"
            )
        columns = _mapping(mapping.get("features"), f"{where}: features")
        known = {str(name): _cost(row, f"{where}: {name}") for name, row in columns.items()}
        unasked = {str(name) for name, row in columns.items() if not row.get("asked", True)}
        costs = {name: cost for name, cost in known.items() if name not in unasked}
        confidence = _number(mapping.get("confidence", 1.0), f"{where}: confidence", 0.0, 1.0)
        rows = {
            **_mapping(mapping.get("faults"), f"{where}: faults"),
            **_unaffected(mapping, where),
        }
        entries, provenance = _entries(rows, known, alphabet, confidence, where)
        return cls(
            str(mapping.get("title", where)),
            alphabet,
            costs,
            entries,
            provenance,
            _nominal(mapping.get("nominal") or {}, costs, where),
            str(mapping.get("provenance", "")),
        )


def _entries(
    rows: Mapping[str, Any],
    costs: Mapping[str, float],
    alphabet: tuple[str, ...],
    confidence: float,
    where: str,
) -> tuple[dict[tuple[str, str], tuple[float, ...]], dict[tuple[str, str], str]]:
    """Probabilities and sources of all entries; ``source`` of a row applies to its entries."""
    entries: dict[tuple[str, str], tuple[float, ...]] = {}
    provenance: dict[tuple[str, str], str] = {}
    for fault, row in rows.items():
        row = dict(_mapping(row, f"{where}: {fault}"))
        source = str(row.pop("source", ""))
        _known(row, frozenset(costs), f"{where}: {fault}")
        for feature in costs:
            entry = row.get(feature)
            if entry is None:
                continue
            place = f"{where}: {fault}, {feature}"
            own = dict(entry) if isinstance(entry, Mapping) else entry
            provenance[fault, feature] = (
                str(own.pop("source", source)) if isinstance(own, dict) else source
            )
            entries[fault, feature] = _probabilities(own, alphabet, confidence, place)
    return entries, provenance


def _unaffected(mapping: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Rows of the faults in section ``unaffected``, which share one list of entries."""
    where = f"{where}: unaffected"
    section = _mapping(mapping.get("unaffected") or {}, where, empty=True)
    _known(section, frozenset({"source", "faults", "entries"}), where)
    names = section.get("faults", [])
    if not isinstance(names, list):
        raise ConfigurationError(f"{where}: faults = {shown(names)} must be a list of fault ids")
    entries = _mapping(section.get("entries", {}), f"{where}: entries", empty=True)
    return {str(name): {"source": section.get("source", ""), **entries} for name in names}


def _probabilities(
    entry: Any, alphabet: tuple[str, ...], confidence: float, where: str
) -> tuple[float, ...]:
    """Probability of each symbol: given one by one, or one symbol with the confidence."""
    if isinstance(entry, Mapping):
        given = {str(symbol): value for symbol, value in entry.items()}
        _known(given, frozenset(alphabet), where)
        numbers = tuple(_number(given.get(s, 0.0), f"{where}: {s}", 0.0, 1.0) for s in alphabet)
        if abs(sum(numbers) - 1.0) > 0.01:
            raise ConfigurationError(f"{where}: probabilities sum to {sum(numbers):g}, must be 1")
        return tuple(number / sum(numbers) for number in numbers)
    if str(entry) not in alphabet:
        raise ConfigurationError(f"{where}: {shown(entry)} is not one of {' '.join(alphabet)}")
    rest = (1.0 - confidence) / (len(alphabet) - 1)
    return tuple(confidence if symbol == str(entry) else rest for symbol in alphabet)


def _nominal(mapping: Any, costs: Mapping[str, float], where: str) -> NominalRanges:
    """Section ``nominal`` of the table."""
    where = f"{where}: nominal"
    mapping = _mapping(mapping, where, empty=True)
    _known(mapping, NOMINAL_KEYS, where)
    known = _mapping(mapping.get("ranges", {}), f"{where}: ranges", empty=True)
    _known(known, frozenset(costs), f"{where}: ranges")
    orders = _mapping(mapping.get("orders", {}), f"{where}: orders", empty=True)
    return NominalRanges(
        _number(mapping.get("rate_hz", 0.0), f"{where}: rate_hz", 0.0, 1e6),
        _number(mapping.get("window_s", 1.0), f"{where}: window_s", 0.01, 60.0),
        _rate(mapping.get("false_alarm_rate", math.nan), f"{where}: false_alarm_rate"),
        _ranges(mapping, "ranges", where),
        _ranges(mapping, "levels", where),
        _ranges(mapping, "resting_levels", where),
        _ranges(mapping, "kurtosis", where),
        {k: _number(v, f"{where}: orders: {k}", 0.01, 1000.0) for k, v in orders.items()},
    )


def _ranges(mapping: Mapping[str, Any], key: str, where: str) -> dict[str, NominalRange]:
    """Nominal ranges of one section by feature or axis."""
    section = _mapping(mapping.get(key, {}), f"{where}: {key}", empty=True)
    return {str(k): NominalRange.from_mapping(v, f"{where}: {k}") for k, v in section.items()}


def _rate(value: Any, where: str) -> float:
    """A share, or NaN if unknown."""
    unknown = isinstance(value, float) and math.isnan(value)
    return math.nan if unknown else _number(value, where, 0.0, 1.0)


def _cost(row: Any, where: str) -> float:
    row = _mapping(row, where)
    _known(row, FEATURE_KEYS, where)
    if not isinstance(row.get("asked", True), bool):
        raise ConfigurationError(f"{where}: asked = {shown(row['asked'])} must be true or false")
    return _number(row.get("cost"), f"{where}: cost", 1e-3, 1e6)


def _known(mapping: Mapping[str, Any], known: frozenset[str], where: str) -> None:
    unknown = sorted(str(key) for key in mapping if str(key) not in known)
    if unknown:
        raise ConfigurationError(
            f"{where}: unknown key {shown(unknown[0])}, known are {', '.join(sorted(known))}"
        )


def _mapping(value: Any, where: str, empty: bool = False) -> Mapping[str, Any]:
    if not isinstance(value, Mapping) or not (value or empty):
        raise ConfigurationError(
            f"{where} = {shown(value)} must be a mapping with at least one entry"
        )
    return value


def _number(value: Any, where: str, low: float, high: float) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
        raise ConfigurationError(
            f"{where} = {shown(value)} must be a number from {low:g} to {high:g}"
        )
    return float(value)
