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

"""One run of a campaign: its records through a new diagnoser, and the result as one line."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from itertools import groupby, islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flea_diag.errors import RecordingError
from flea_diag.formats import stamped
from flea_diag.tools.arena.entrant import Arena
from flea_diag.tools.campaign.campaign import expected_of
from flea_diag.tools.campaign.case import Case
from flea_diag.tools.campaign.run_result import NOMINAL, RunResult
from flea_diag.tools.campaign.run_trace import RunTrace, write_trace
from flea_diag.tools.evaluate.case_pool import failed
from flea_diag.tools.motion import moving_s
from flea_diag.tools.origin import commit, today
from flea_diag.tools.peak_memory import forget_peak, peak_bytes
from flea_diag.tools.refused import why_failed
from flea_diag.tools.replay.summary import BULK, summarise
from flea_diag.wire.blocks import Block, ScanBlock
from flea_diag.wire.records import NEVER_NS, Record, Scan, Truth

if TYPE_CHECKING:
    from flea_diag.stages import Stage

DETAILS = "runs"
"""Folder of the replay summaries, below the evaluation's."""

MOST_SCANS = 2048
"""In a block."""

ALONE = Arena()
"""No diagnosers but ours."""

Expect = Mapping[str, tuple[str, ...]]


@dataclass
class CaseDiagnosis:
    """Records that a stage produced in a run, and the truth that it did not receive."""

    kept: list[Record | Block] = field(default_factory=list)
    truths: list[Truth] = field(default_factory=list)
    cpu_s: float = 0.0
    peak_bytes: int = 0
    """Of a process of its own; 0: the stage has none."""
    trace: RunTrace = field(default_factory=RunTrace)

    @property
    def start_ns(self) -> int:
        """Stamp of the first scan."""
        for record in self.kept:
            if isinstance(record, ScanBlock):
                return int(record.stamps_ns[0])
            if isinstance(record, Scan):
                return record.stamp_ns
        return NEVER_NS

    def take(self, records: Iterable[Record | Block]) -> None:
        """Keep what is scored, and a trace of what is drawn."""
        for record in records:
            self.trace.add(record)
            if not isinstance(record, BULK):
                self.kept.append(record)


def run_case(case: Case, expect: Expect, folder: Path, arena: Arena = ALONE) -> RunResult:
    """Diagnose one run; any error becomes a failed line."""
    try:
        forget_peak()
        with closing(_stage(case, arena)) as stage:
            done = diagnose(records(case), stage)
        result, summary = scored(case, expect, done)
        _write_detail(folder / result.detail, case, result, summary)
        write_trace(folder / result.detail, done.trace)
        return result
    except Exception as error:  # a defect: the campaign continues, the line names the place
        return failed(case, why_failed(error))


def records(case: Case) -> Iterable[Record]:
    """Records of a run, the truth among them."""
    from flea_diag.tools.campaign.case_records import records_of

    return records_of(case.recipe)


@contextmanager
def closing(stage: Stage) -> Iterator[Stage]:
    """The stage, closed at the end whatever happens: it may have a process of its own."""
    try:
        yield stage
    finally:
        getattr(stage, "close", tuple)()


def _stage(case: Case, arena: Arena) -> Stage:
    from flea_diag.configuration.stand import load_stand
    from flea_diag.tools.evaluate.baselines import Setting, baseline

    stand = load_stand(case.stand, calibration=case.calibration)
    bags = tuple(Path(bag) for bag in case.learned_from)
    entrant = arena.find(case.configuration)
    if entrant is not None:
        from flea_diag.tools.arena.facts import foreign_stage

        return foreign_stage(entrant, arena, stand, bags)
    setting = Setting(stand, bags, Path(case.classifier) if case.classifier else None)
    return baseline(case.configuration).make(setting)


def diagnose(records: Iterable[Record], stage: Stage) -> CaseDiagnosis:
    """Feed a stage the records of a stand; no stage receives the truth."""
    done = CaseDiagnosis()
    clock = time.process_time
    by_block = getattr(stage, "handle_block", None)
    for record in records if by_block is None else in_blocks(records):
        if isinstance(record, Truth):
            done.truths.append(record)
            done.trace.add(record)
            continue
        begin = clock()
        caused = by_block(record) if isinstance(record, ScanBlock) else stage.handle(record)
        done.cpu_s += clock() - begin
        done.take((record, *caused))
    begin = clock()
    held: tuple[Record, ...] = getattr(stage, "finish", tuple)()
    done.cpu_s += clock() - begin
    done.cpu_s += getattr(stage, "cpu_s", 0.0)
    done.peak_bytes = getattr(stage, "peak_bytes", 0)
    done.take(held)
    return done


def in_blocks(records: Iterable[Record]) -> Iterator[Record | ScanBlock]:
    """The same records, with consecutive scans joined into blocks."""
    for kind, part in groupby(records, key=_layout):
        if kind is None:
            yield from part
            continue
        while rows := list(islice(part, MOST_SCANS)):
            yield ScanBlock.of(*rows)


def _layout(record: Record) -> tuple[str, ...] | None:
    return record.channels if isinstance(record, Scan) else None


def scored(case: Case, expect: Expect, done: CaseDiagnosis) -> tuple[RunResult, dict[str, Any]]:
    """Result of a run, and the summary that it is made of."""
    from flea_diag.tools.campaign.case_records import first_fault
    from flea_diag.tools.numeric_backend import numeric_backend
    from flea_diag.wire.records import AmbiguityGroup

    summary = summarise(done.kept)
    if not summary["scans"]:
        raise RecordingError("no scan (topic sensors/slow): nothing to diagnose")
    if not done.truths:
        # Assumed healthy, it would count as right or as a false alarm.
        raise RecordingError("no truth, so it cannot be scored: diagnose it with flea replay")
    start_ns = done.start_ns
    last = next((r for r in reversed(done.kept) if isinstance(r, AmbiguityGroup)), None)
    truth = first_fault(done.truths)
    told = _told(truth, expect, start_ns)
    computed = tuple(summary["features_computed"])
    verdict = _verdict(summary, told["onset_s"], start_ns)
    if truth and "detection_time_s" in verdict:
        moved_s = moving_s(done.kept, truth.onset_ns, verdict["detected_stamp_ns"])
        verdict["detection_motion_s"] = round(moved_s, 6)
    result = RunResult(
        case.id,
        case.kind,
        case.row,
        case.configuration,
        case.fold,
        words=last.words if last else "",
        not_observable=tuple(entry["fault"] for entry in summary["not_observable"]),
        features_computed=computed,
        features_skipped=max((last.features_available if last else 0) - len(computed), 0),
        cpu_s=round(done.cpu_s, 6),
        peak_memory_bytes=done.peak_bytes or peak_bytes(),
        digest=summary["digest"],
        decision_digest=summary["decision_digest"],
        backend=numeric_backend(),
        detail=f"{DETAILS}/{case.configuration}/{case.id.replace('/', '.')}{case.fold}.json",
        date=today(),
        commit=commit(),
        stand=case.stand,
        duration_s=summary["duration_s"],
        **told,
        **verdict,
    )
    return result, summary


def _told(truth: Truth | None, expect: Expect, start_ns: int) -> dict[str, Any]:
    """Fields of the truth; without a fault the run is nominal."""
    if truth is None:
        return {"truth": NOMINAL, "onset_s": None, "expected": expected_of(NOMINAL, expect)}
    details = dict(truth.details)
    return {
        "truth": truth.fault,
        "onset_s": (truth.onset_ns - start_ns) / 1e9,
        "size": _number(details.get("size")),
        "size_unit": details.get("size_unit", ""),
        "expected": expected_of(truth.fault, expect),
    }


def _number(text: str | None) -> float | None:
    try:
        return None if text is None else float(text)
    except ValueError:
        return None


def _verdict(summary: dict[str, Any], onset_s: float | None, start_ns: int) -> dict[str, Any]:
    """Fields of the verdict; times relative to the onset if there is one."""
    episodes = summary["episodes"]
    alarms = tuple(episode["detected_at_s"] for episode in episodes)
    quiet_s = summary["duration_s"] if onset_s is None else onset_s
    found: dict[str, Any] = {
        "outcome": summary["outcome"] or "",
        "alarms_s": alarms,
        "false_alarms": sum(1 for at_s in alarms if onset_s is None or at_s < onset_s),
        "nominal_s": quiet_s,
    }
    if not episodes:
        return found
    final = episodes[-1]
    detected_s, settled_s = final["detected_at_s"], final["settled_at_s"]
    found |= {
        "outcome": final["outcome"],
        "group": tuple(final["ambiguity_group"]),
        "probabilities": tuple(final["probabilities"]),
        "detected_stamp_ns": start_ns + round(detected_s * 1e9),
        "isolated_stamp_ns": start_ns + round(settled_s * 1e9),
    }
    if onset_s is not None and detected_s >= onset_s:
        found["detection_time_s"] = round(detected_s - onset_s, 6)
        found["isolation_time_s"] = round(settled_s - onset_s, 6)
    return found


def _write_detail(path: Path, case: Case, result: RunResult, summary: dict[str, Any]) -> None:
    from flea_diag.tools.terminal import make_folder, write_json

    make_folder(path.parent)
    said = {**summary, "words": result.words}
    content = {"case": asdict(case), "result": asdict(result), "summary": said}
    write_json(str(path), stamped("run detail", content))
