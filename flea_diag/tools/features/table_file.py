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

"""Learned fault feature tables as YAML files with their provenance."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from flea_diag.core.choice.feature_learning import NOMINAL, SYMBOLS, Ends, FeatureStatistics
from flea_diag.core.vibration.nominal_range import NominalRange
from flea_diag.formats import stamped
from flea_diag.tools.terminal import write_text


@dataclass(frozen=True)
class Making:
    """Provenance of a table, for its header."""

    title: str
    provenance: str
    source: str
    rate_hz: float
    window_s: float
    false_alarm_rate: float
    orders: Mapping[str, float]


def table_mapping(
    learned: FeatureStatistics,
    features: Mapping[str, Ends],
    heard: Mapping[str, Ends],
    costs: Mapping[str, float],
    levels: Mapping[str, Mapping[str, NominalRange]],
    unaffected: Iterable[str],
    making: Making,
    window_errors: Mapping[str, Mapping[str, float]],
) -> dict[str, Any]:
    """Plain values of a learned table with the chosen features and the ends of their ranges.

    ``heard``: features that are never requested, with entries for the alarms of the vibration
    monitor; ``levels``: section of the file -> range of each axis; ``unaffected`` faults have the
    entries of nominal windows; ``window_errors``: see `FaultFeatureTable`.
    """
    columns = {**features, **heard}
    rows: dict[str, Any] = {
        fault: {
            "source": f"{making.source}, {learned.counts[fault]} windows",
            **{f: _entry(learned.probability(fault, f, ends)) for f, ends in columns.items()},
        }
        for fault in learned.faults
    }
    nominal = {f: _entry(learned.probability(NOMINAL, f, ends)) for f, ends in columns.items()}
    return {
        "title": making.title,
        "provenance": making.provenance,
        "window_error": {there: _Inline(row) for there, row in window_errors.items()},
        "alphabet": list(SYMBOLS),
        "features": {
            **{feature: {"cost": costs[feature]} for feature in features},
            **{feature: {"cost": costs[feature], "asked": False} for feature in heard},
        },
        "faults": rows,
        "unaffected": {
            "source": f"assumed to act on no accelerometer: entries of {NOMINAL} windows",
            "faults": list(unaffected),
            "entries": nominal,
        },
        "nominal": {
            "rate_hz": _rounded(making.rate_hz),
            "window_s": making.window_s,
            "false_alarm_rate": making.false_alarm_rate,
            "orders": {name: _rounded(order) for name, order in making.orders.items()},
            "ranges": {
                f: _rounded_range(learned.range_of(f, ends)) for f, ends in features.items()
            },
            **{
                section: {axis: _rounded_range(found) for axis, found in ranges.items()}
                for section, ranges in levels.items()
            },
        },
    }


def write_table(path: Path, mapping: Mapping[str, Any], header: Sequence[str]) -> None:
    """Write a table below comment lines with its provenance.

    Raises
    ------
    ConfigurationError
        The file cannot be written.
    """
    lines = [f"# {line}".rstrip() for line in header]
    body = yaml.dump(stamped("feature table", mapping), Dumper=_Dumper, sort_keys=False, width=100)
    write_text(path, "\n".join([*lines, body]))


class _Inline(dict[str, Any]):
    """A mapping written on one line."""


class _Dumper(yaml.SafeDumper):  # type: ignore[misc,unused-ignore]
    """YAML dumper with one line per entry and without aliases, for readability."""

    def ignore_aliases(self, data: Any) -> bool:
        """Never write anchors."""
        return True


_Dumper.add_representer(
    _Inline,
    lambda dumper, value: dumper.represent_mapping("tag:yaml.org,2002:map", value, flow_style=True),
)


def _entry(probabilities: Sequence[float]) -> _Inline:
    """Probabilities rounded to three digits with sum 1: the largest one absorbs the remainder."""
    rounded = [round(p, 3) for p in probabilities]
    largest = rounded.index(max(rounded))
    rounded[largest] = round(1.0 - sum(rounded[:largest] + rounded[largest + 1 :]), 3)
    return _Inline(zip(SYMBOLS, rounded, strict=True))


def _rounded_range(found: NominalRange) -> _Inline:
    plain = found.as_mapping()
    return _Inline({key: _rounded(value) for key, value in plain.items()})


def _rounded(value: Any) -> Any:
    if isinstance(value, list):
        return [_rounded(item) for item in value]
    return float(f"{value:.6g}") if isinstance(value, float) else value
