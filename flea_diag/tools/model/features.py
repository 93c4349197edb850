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

"""Faults that no fault feature table separates, for ``flea model diagnosability``."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from flea_diag.configuration.files import config_path
from flea_diag.configuration.knowledge import load_features
from flea_diag.core.choice.feature_table import FaultFeatureTable

PAPER_TABLE = "feature_table_paper.yaml"
"""Table of the founding paper."""


def never_split(features: Path, faults: Iterable[str]) -> dict[str, list[list[str]]]:
    """Groups of faults with equal symbols in every feature, by title of the table.

    The tables are that of the stand and that of the founding paper.
    """
    faults = list(faults)
    tables = [load_features(path) for path in (features, config_path(PAPER_TABLE))]
    return {table.title: _groups(table, faults) for table in tables}


def _groups(table: FaultFeatureTable, faults: list[str]) -> list[list[str]]:
    known = [fault for fault in faults if fault in table.faults]
    return [sorted(group) for group in table.inseparable(known) if len(group) > 1]


def in_words(groups: dict[str, list[list[str]]]) -> list[str]:
    """Lines of text for the terminal."""
    lines = ["", "Not separable by vibration features (identical symbols):"]
    for title, found in groups.items():
        lines.append(f"  {title}:" + ("" if found else " none, all pairs are separable"))
        lines += [f"    {{{', '.join(group)}}}" for group in found]
    return lines
