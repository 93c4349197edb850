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

"""The decision of one run, from an evaluation or a replay, and how two decisions differ."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import zip_longest
from pathlib import Path
from typing import Any, TypeVar

from flea_diag.errors import RecordingError
from flea_diag.fields.reader import read_as
from flea_diag.fields.values import FINITE
from flea_diag.formats import migrated
from flea_diag.tools.campaign.result_log import RESULTS, read_results
from flea_diag.tools.campaign.run_result import RunResult
from flea_diag.tools.campaign.run_trace import MOST_VALUES
from flea_diag.wire.bags.bag_layout import refuse_closed
from flea_diag.wire.json_text import parse_json
from flea_diag.wire.regular_file import read_text

R = TypeVar("R")

LARGEST_JSON_BYTES = 64 << 20


@dataclass(frozen=True)
class ReplayStep:
    """The group at a change of its members or of its outcome."""

    at_s: float
    outcome: str
    members: tuple[str, ...]


@dataclass(frozen=True)
class ReplayEpisode:
    """The compared part of one episode; older files lack evidence and steps."""

    outcome: str
    detected_at_s: float
    ambiguity_group: tuple[str, ...]
    detected_by: str = ""
    kept: Mapping[str, str] = field(default_factory=dict)
    dropped: Mapping[str, str] = field(default_factory=dict)
    steps: tuple[ReplayStep, ...] = ()


@dataclass(frozen=True)
class ReplaySummary:
    """The compared part of the JSON of ``flea replay``."""

    bag: str
    outcome: str | None
    ambiguity_group: tuple[str, ...]
    digest: str
    episodes: tuple[ReplayEpisode, ...]
    decision_digest: str = ""
    backend: str = ""


@dataclass(frozen=True)
class DetailSummary:
    """The compared part of the summary in the details of a run."""

    episodes: tuple[ReplayEpisode, ...]


@dataclass(frozen=True)
class Decision:
    """Verdict of one run; ``episodes`` are those of a replay's summary, with their evidence."""

    name: str
    outcome: str
    group: tuple[str, ...]
    alarms_s: tuple[float, ...]
    episodes: tuple[ReplayEpisode, ...] = ()
    digest: str = ""
    decision_digest: str = ""
    backend: str = ""
    right: bool | None = None
    failure: str = ""

    @property
    def verdict(self) -> tuple[Any, ...]:
        """What must be equal for two decisions to be equal."""
        said = [(e.outcome, sorted(e.ambiguity_group)) for e in self.episodes]
        return self.outcome, self.group, self.alarms_s, said, bool(self.failure)

    def same_numbers(self, other: Decision) -> bool:
        """Whether both have the same numbers; older files have only the digest with wording."""
        if self.decision_digest and other.decision_digest:
            return self.decision_digest == other.decision_digest
        return self.digest == other.digest

    def words(self) -> str:
        """The verdict in one line."""
        if self.failure:
            return f"failed: {self.failure}"
        members = ", ".join(self.group)
        when = ", ".join(f"{at_s:.2f} s" for at_s in self.alarms_s)
        return (
            self.outcome + (f" {{{members}}}" if members else "") + (f" at {when}" if when else "")
        )


def read_decisions(path: Path) -> dict[str, Decision]:
    """Decisions by name of the run: of an evaluation's folder, its lines, or a replay's JSON.

    Raises
    ------
    RecordingError
        The path is neither, or cannot be read.
    """
    refuse_closed(path)
    if path.is_dir() or path.suffix == ".jsonl":
        folder = path if path.is_dir() else path.parent
        if path.is_dir() and not (path / RESULTS).is_file():
            found = _of_files(sorted(path.glob("*.json")))
            if found:
                return found
            raise RecordingError(f"{path}: holds neither {RESULTS} nor JSON files of flea replay")
        return {each.name: each for each in _of_results(read_results(path), folder)}
    return _of_files([path])


def _of_files(paths: list[Path]) -> dict[str, Decision]:
    found: dict[str, Decision] = {}
    for path in paths:
        content = _json(path)
        for summary in content if isinstance(content, list) else [content]:
            summary = migrated("replay summary", summary, str(path))
            decision = _of_summary(summary, path)
            found[decision.name] = decision
    return found


def _of_results(results: tuple[RunResult, ...], folder: Path) -> Iterator[Decision]:
    for result in results:
        name = "/".join(part for part in (result.configuration, result.id, result.fold) if part)
        detail = folder / result.detail
        told = bool(result.detail) and detail.is_file()
        yield Decision(
            name,
            result.outcome,
            tuple(sorted(result.group)),
            result.alarms_s,
            _of_detail(detail) if told else (),
            result.digest,
            result.decision_digest,
            result.backend,
            result.right,
            result.failure,
        )


def _of_detail(path: Path) -> tuple[ReplayEpisode, ...]:
    detail = migrated("run detail", _json(path), str(path))
    summary = migrated("replay summary", detail.get("summary"), str(path))
    return _shaped(DetailSummary, summary, path).episodes


def _of_summary(content: Any, path: Path) -> Decision:
    summary = _shaped(ReplaySummary, content, path)
    return Decision(
        Path(summary.bag).name,
        str(summary.outcome),
        tuple(sorted(summary.ambiguity_group)),
        tuple(episode.detected_at_s for episode in summary.episodes),
        summary.episodes,
        summary.digest,
        summary.decision_digest,
        summary.backend,
    )


def _shaped(kind: type[R], content: Any, path: Path) -> R:
    """The compared part of some JSON; what else it holds is passed over."""
    where = f"{path}: not the JSON of a replay, write it with flea replay --json"
    return read_as(kind, content, where, error=RecordingError, magnitudes=FINITE, strict=False)


def _json(path: Path) -> Any:
    try:
        text = read_text(path, LARGEST_JSON_BYTES)
        return parse_json(text, largest=LARGEST_JSON_BYTES, most_values=MOST_VALUES)
    except (OSError, ValueError) as error:
        raise RecordingError(f"{path}: cannot be read as JSON: {error}") from error


# --- how two differ -----------------------------------------------------------------------


def differences(a: Decision, b: Decision) -> list[str]:
    """What changed, when, and by which evidence."""
    lines = [f"{a.words()}  ->  {b.words()}"]
    for number, (one, other) in enumerate(zip_longest(a.episodes, b.episodes), 1):
        lines += [f"episode {number}: {line}" for line in _of_episodes(one, other)]
    return lines


def _of_episodes(a: ReplayEpisode | None, b: ReplayEpisode | None) -> Iterator[str]:
    if a is None or b is None:
        which, only = ("A", a) if b is None else ("B", b)
        yield f"in {which} only, {_opened(only)}"
        return
    if _opened(a) != _opened(b):
        yield f"{_opened(a)}  ->  {_opened(b)}"
    parting = _parting(a.steps, b.steps)
    if parting:
        yield parting
    for fault in sorted(set(a.ambiguity_group) ^ set(b.ambiguity_group)):
        yield f"{fault}: A {_held(a, fault)}; B {_held(b, fault)}"


def _opened(episode: ReplayEpisode) -> str:
    by = episode.detected_by or "an unknown residual"
    return f"detected at {episode.detected_at_s} s by {by}"


def _parting(a: tuple[ReplayStep, ...], b: tuple[ReplayStep, ...]) -> str:
    """The step at which the two groups first differ."""
    for one, other in zip(a, b, strict=False):
        if (one.outcome, one.members) != (other.outcome, other.members):
            return f"they differ at {one.at_s} s ({_step(one)}) and {other.at_s} s ({_step(other)})"
    longer, which = (a, "A") if len(a) > len(b) else (b, "B")
    rest = longer[min(len(a), len(b)) :]
    return f"{which} continues at {rest[0].at_s} s ({_step(rest[0])})" if rest else ""


def _step(step: ReplayStep) -> str:
    members = step.members
    named = ", ".join(members[:4]) + (f" and {len(members) - 4} more" if len(members) > 4 else "")
    return f"{step.outcome} {{{named}}}"


def _held(episode: ReplayEpisode, fault: str) -> str:
    if fault in episode.ambiguity_group:
        return f"kept it ({episode.kept.get(fault, 'no reason recorded')})"
    return f"dropped it ({episode.dropped.get(fault, 'never in the group')})"
