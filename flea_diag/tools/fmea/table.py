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

"""The FMEA as a table: CSV for other programs, one page of HTML for people."""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any
from urllib.parse import quote

from flea_diag.tools.fmea.failure import DETECTION, AnalysedFailure
from flea_diag.tools.fmea.motion_effect import MotionEffect
from flea_diag.tools.score.report import rendered

Row = dict[str, Any]


def cells(line: AnalysedFailure) -> Row:
    """One line by columns; None where nothing is known."""
    failure, effect = line.failure, line.effect
    return {
        "component": failure.component,
        "failure_mode": failure.title,
        "fault": failure.fault,
        "size": failure.size,
        "size_unit": failure.size_unit,
        **({} if effect is None else asdict(effect)),
        "severity": line.severity,
        "occurrence": line.occurrence,
        "detection": line.detection,
        "risk_priority_number": line.risk,
        "became": line.became,
        "outcome": line.outcome,
        "group": list(line.group),
        "detected_by": line.detected_by,
        "delay_s": line.delay_s,
        "what_to_do": line.to_do,
        "remark": line.broken or line.remark,
        "bag": line.bag,
    }


EFFECTS = tuple(MotionEffect.__dataclass_fields__)
COLUMNS = (
    "component", "failure_mode", "fault", "size", "size_unit", *EFFECTS, "severity", "occurrence",
    "detection", "risk_priority_number", "became", "outcome", "group", "detected_by", "delay_s",
    "what_to_do", "remark", "bag",
)  # fmt: skip


def as_csv(lines: Sequence[AnalysedFailure]) -> str:
    """The lines with a heading, in their order; text that a spreadsheet would run is quoted."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(COLUMNS)
    for line in lines:
        row = cells(line)
        table.writerow([_plain(row.get(name)) for name in COLUMNS])
    return text.getvalue()


def _plain(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list):
        return " ".join(value)
    words = str(value)
    return f"'{words}" if words[:1] in ("=", "+", "-", "@") else words


def as_html(
    title: str, made: str, lines: Sequence[AnalysedFailure], nominal: MotionEffect | None, unit: str
) -> str:
    """The page.

    Parameters
    ----------
    made
        When and of what it was made.
    nominal
        The motion without a failure; None where nothing was simulated.
    unit
        Of the tracking error.

    Raises
    ------
    ConfigurationError
        Jinja2 is not installed.
    """
    return rendered(
        "fmea.html",
        title=title,
        made=made,
        nominal=nominal and _effect(nominal, unit),
        counts=counts(lines),
        ratings=list(DETECTION.items()),
        rows=[_shown(line, unit) for line in lines],
    )


def counts(lines: Sequence[AnalysedFailure]) -> list[tuple[str, int]]:
    """How many became what, the best first."""
    found = Counter(line.became for line in lines)
    return sorted(found.items(), key=lambda entry: DETECTION.get(entry[0], 99))


def _effect(effect: MotionEffect, unit: str) -> str:
    rms, peak = 1e3 * effect.tracking_rms, 1e3 * effect.tracking_peak
    tracking = f"tracking {rms:.2f} m{unit} rms, {peak:.2f} m{unit} peak"
    return f"{tracking}; {effect.current_rms_a:.2f} A rms; {effect.winding_degc:.1f} °C"


def _shown(line: AnalysedFailure, unit: str) -> Row:
    """A line as the page shows it."""
    size = line.failure.size
    return {
        **cells(line),
        "size": "" if size is None else f"{size:.4g} {line.failure.size_unit}",
        "effect": _effect(line.effect, unit) if line.effect else "",
        "group": ", ".join(line.group),
        "delay": "" if line.delay_s is None else f"{line.delay_s:.2f}",
        "good": (line.detection or 99) <= DETECTION["in the group"],
        "link": quote(line.bag),
    }
