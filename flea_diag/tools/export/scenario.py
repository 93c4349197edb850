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

"""Scenarios of the diagnosis competitions (DXC): sensors, injected faults, diagnoses over time.

One message a line, times in whole milliseconds from the first scan, as the synthetic track of
the competitions writes them: ``sensors @0 { a = 1.0, b = 2.0 };`` and
``faultInjection @5000 isInjection = true, fault = { jam = faulty }, parameters = { size = 0.4 };``
A diagnosis has the fields of the competitions' message: ``diagnosis @6500 detectionSignal = true,
isolationSignal = true, candidates = { { weight = 0.97, faults = { jam = faulty } } }, notes = "";``
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from flea_diag.errors import visible
from flea_diag.tools.terminal import write_text
from flea_diag.wire.records import NEVER_NS, AmbiguityGroup, Candidate, Outcome, Truth

if TYPE_CHECKING:
    from flea_diag.api.diagnosis import Diagnosis
    from flea_diag.api.recording import Recording
    from flea_diag.api.table import Table

NOMINAL = ("", "nominal")
ISOLATED = (Outcome.ISOLATED, Outcome.INDISTINGUISHABLE)
"""Outcomes whose candidates are the last word, as the isolation signal of a diagnosis says."""

Line = tuple[int, str]


def save_scenario(recording: Recording, target: Path, told: Diagnosis | None = None) -> None:
    """Write a recording with its truth as a scenario, with the diagnosis where there is one.

    Raises
    ------
    RecordingError
        There is no scan in it.
    ConfigurationError
        The file cannot be written.
    """
    table = recording.table
    faults = sorted(_faults(recording.truth, int(table.attrs["start_ns"])))
    verdicts = [] if told is None else list(_diagnoses(told))
    lines = heapq.merge(faults, _sensors(table), verdicts, key=lambda line: line[0])
    write_text(target, "".join(f"{text}\n" for _, text in lines))


def _sensors(table: Table) -> Iterator[Line]:
    names = [name for name in table if name != table.index]
    rows = zip(*(table[name].tolist() for name in names), strict=True)
    for time_s, row in zip(table[table.index].tolist(), rows, strict=True):
        read = zip(names, row, strict=True)
        known = ", ".join(f"{name} = {value!r}" for name, value in read if math.isfinite(value))
        at_ms = round(1e3 * time_s)
        yield at_ms, f"sensors @{at_ms} {{ {known} }};"


def _faults(truths: tuple[Truth, ...], start_ns: int) -> Iterator[Line]:
    for truth in truths:
        if truth.fault in NOMINAL or truth.onset_ns == NEVER_NS:
            continue
        at_ms = round((truth.onset_ns - start_ns) / 1e6)
        size = dict(truth.details).get("size")
        said = f" size = {size} " if size is not None else ""
        yield (
            at_ms,
            f"faultInjection @{at_ms} isInjection = true, fault = {{ {truth.fault} = faulty }}, "
            f"parameters = {{{said}}};",
        )


def _diagnoses(told: Diagnosis) -> Iterator[Line]:
    """One message a change of the candidates or of a signal."""
    before = ""
    for group in told.groups:
        said = _message(group)
        if said != before:
            before = said
            at_ms = round((group.stamp_ns - told.start_ns) / 1e6)
            notes = visible(group.words).replace('"', "'")
            yield at_ms, f'diagnosis @{at_ms} {said}, notes = "{notes}";'


def _message(group: AmbiguityGroup) -> str:
    found = ", ".join(map(_candidate, group.members))
    signals = {"detection": group.episode > 0, "isolation": group.outcome in ISOLATED}
    told = ", ".join(f"{name}Signal = {str(on).lower()}" for name, on in signals.items())
    return f"{told}, candidates = {{ {found} }}" if found else f"{told}, candidates = {{ }}"


def _candidate(row: Candidate) -> str:
    weight = f"weight = {row.probability!r}, " if math.isfinite(row.probability) else ""
    return f"{{ {weight}faults = {{ {row.fault} = faulty }} }}"
