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

"""What each mechanism of the evidence is worth: the same runs without it.

    scripts/bench ablate                                        the real recordings, by halves
    scripts/bench ablate --campaign bench/evidence/wing.yaml    other runs, repeatable

Each run is diagnosed as it is, and without one mechanism after the other. A run is touched where
anything that it says is another one. Idle is what loses no run, adds no wrong name and no alarm in
at least 200 runs that it touches: fewer say nothing.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from summary import ROOT, Figure, bench_parser, write_summary

from flea_diag.configuration.component import evidence_pipeline
from flea_diag.configuration.stand import load_stand
from flea_diag.core.evidence import fault_evidence, hypotheses, white_stream
from flea_diag.core.evidence.fault_evidence import FaultEvidence
from flea_diag.core.evidence.friction import Friction
from flea_diag.core.evidence.hypotheses import StreamHypotheses
from flea_diag.core.evidence.hypothesis_bank import HypothesisBank
from flea_diag.core.evidence.marginal_ratio import marginal_ratio
from flea_diag.core.residuals.stop import Stop
from flea_diag.core.run_law.law_noise import LawNoise
from flea_diag.errors import FleaError
from flea_diag.stages.evidence import evidence_group, stream_evidence
from flea_diag.stages.evidence.evidence_outcome import EvidenceOutcome
from flea_diag.stages.evidence.sensor_modes import SensorModes
from flea_diag.tools.campaign.campaign import load_campaign
from flea_diag.tools.campaign.case import Case, plan
from flea_diag.tools.campaign.recording_set import RecordingSet
from flea_diag.tools.campaign.run_result import RunResult
from flea_diag.tools.evaluate.case_run import diagnose, records, scored
from flea_diag.tools.evaluate.evidence import evidence_stand
from flea_diag.tools.refused import Refused
from flea_diag.tools.workers import in_order

EVIDENCE = "evidence"
ENOUGH = 200
COUNTS = ("lost", "gained", "wrong", "alarms")
Patches = tuple[tuple[Any, str, Any], ...]


def ones(self: Any, motion: Any) -> float:
    """Loudness of any window."""
    return 1.0


def nothing_feigned(self: StreamHypotheses, sums: Any, from_before: Any) -> Any:
    """Of healthy recordings that feign no fault."""
    return np.zeros(sums.cross.shape[:-2])


def no_unit(self: HypothesisBank) -> Any:
    """Evidence of another unit, where there is none."""
    return np.full(len(self.onsets), -np.inf)


def bounded(self: StreamHypotheses, sums: Any) -> Any:
    """Evidence of faults whose size reaches no farther than its prior."""
    return marginal_ratio(sums, self.signatures.prior)


MECHANISMS: dict[str, Patches] = {
    "a window counts less that is far out": ((white_stream, "BOUND", 1e9),),
    "models are not exact": ((white_stream, "MODEL_ERROR", 0.0),),
    "a share of the best parts no two": ((evidence_group, "INEXACT", 0.0),),
    "few windows must say more": (
        (evidence_group, "patience", lambda windows: 1.0),
        (stream_evidence, "patience", lambda windows: 1.0),
    ),
    "a stream is as loud as before": ((fault_evidence, "LAW_WINDOWS", 1e12),),
    "windows about the onset left out": (
        (fault_evidence, "smoothed", lambda onsets: frozenset[int]()),
    ),
    "up to three onsets": ((stream_evidence, "MOST_ONSETS", 1),),
    "another unit": (
        (HypothesisBank, "_unit_evidence", no_unit),
        (FaultEvidence, "_unit", lambda self, own, faults: -1e9),
    ),
    "what healthy recordings feign": ((StreamHypotheses, "of_healthy", nothing_feigned),),
    "sizes reach as far as data show": ((StreamHypotheses, "evidence", bounded),),
    "beyond noise a signal is as read": ((hypotheses, "BOUND", 1e9),),
    "noise grows with the motion": ((LawNoise, "loudness", ones),),
    "a slow window is louder": ((Friction, "loudness", ones),),
    "dry friction holds at rest": (
        (Friction, "held", lambda self, window: np.zeros(len(self.dry))),
    ),
    "near an end a stop may push": (
        (Stop, "near", lambda self, places: np.zeros(len(places), dtype=bool)),
    ),
    "a mode shows what defines it": ((SensorModes, "_shows", lambda self, fault: True),),
    "no fault explains": ((EvidenceOutcome, "_contradiction", lambda self, *what: None),),
}
"""What is taken out, and what stands in its place."""


@contextmanager
def without(name: str) -> Iterator[None]:
    """The evidence without a mechanism; empty: the whole."""
    with ExitStack() as stack:
        for owner, attribute, other in MECHANISMS.get(name, ()):
            stack.enter_context(patch.object(owner, attribute, other))
        yield


@dataclass
class Worth:
    """Runs that taking out one mechanism touches, and what becomes of them."""

    touched: int = 0
    lost: int = 0
    gained: int = 0
    wrong: int = 0
    alarms: int = 0

    def count(self, whole: RunResult, other: RunResult) -> None:
        """Add one run."""
        self.touched += told(whole) != told(other)
        self.lost += whole.right and not other.right
        self.gained += other.right and not whole.right
        self.wrong += other.misnamed - whole.misnamed
        self.alarms += other.false_alarms - whole.false_alarms


def told(result: RunResult) -> tuple[object, ...]:
    """All that a run says to those who watch."""
    return result.outcome, result.group, result.alarms_s


def runs_of(path: Path, folder: Path) -> Iterator[tuple[Case, Any]]:
    """Runs of a campaign that the evidence diagnoses, and what each may be called."""
    campaign = load_campaign(path)
    recordings = RecordingSet(campaign, folder)
    cases = [case for case in plan(campaign, recordings) if case.configuration == EVIDENCE]
    if not cases:
        raise FleaError(f"{path}: no configuration `{EVIDENCE}`: list it under configurations")
    recordings.prepare()
    for case in cases:
        yield case, dict(campaign.expect)


def judged(run: tuple[Case, Any]) -> dict[str, RunResult]:
    """One run by the whole, under an empty name, and without each mechanism."""
    case, expect = run
    stand = load_stand(case.stand, calibration=case.calibration)
    known = evidence_stand(stand, tuple(Path(bag) for bag in case.learned_from))
    results = {}
    for name in ("", *MECHANISMS):
        with without(name):
            done = diagnose(records(case), evidence_pipeline(known, stand))
            results[name], _ = scored(case, expect, done)
    return results


def figures(worth: dict[str, Worth]) -> Iterator[Figure]:
    """Runs without each mechanism: always those that are lost, the rest where there are any."""
    for name, of in worth.items():
        for what in COUNTS:
            count = getattr(of, what)
            if count or what == "lost":
                yield Figure(f"{name}: {what}", count, "runs", of.touched)


def words(worth: dict[str, Worth]) -> Iterator[str]:
    """The table for people."""
    yield f"{'taken out':36s} " + " ".join(f"{name:>7s}" for name in ("touched", *COUNTS))
    for name, of in worth.items():
        row = " ".join(f"{getattr(of, what):7d}" for what in ("touched", *COUNTS))
        few = "" if of.touched >= ENOUGH else "   too few to be called idle"
        yield f"{name:36s} {row}{few}"


def main() -> None:
    """Take out one mechanism after the other."""
    parser = bench_parser(__doc__)
    parser.add_argument(
        "--campaign", type=Path, action="append", metavar="FILE",
        help="runs, repeatable (default: bench/evidence/real.yaml)",
    )  # fmt: skip
    parser.add_argument("-j", "--jobs", type=int, default=1, help="processes (default 1)")
    arguments = parser.parse_args()
    worth = {name: Worth() for name in MECHANISMS}
    count = 0
    with TemporaryDirectory() as folder:
        for path in arguments.campaign or [ROOT / "bench/evidence/real.yaml"]:
            runs = list(runs_of(path.resolve(), Path(folder) / path.stem))
            for results in in_order(judged, runs, arguments.jobs):
                if isinstance(results, Refused):
                    raise FleaError(results.words)
                for name, of in worth.items():
                    of.count(results[""], results[name])
                count += 1
    print(f"{count} runs")
    print("\n".join(words(worth)))
    write_summary("ablate", figures(worth), arguments.json)


if __name__ == "__main__":
    main()
