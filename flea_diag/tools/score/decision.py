"""The decision of one run, from an evaluation or a replay, and how two decisions differ."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from typing import Any

from flea_diag.errors import RecordingError
from flea_diag.formats import migrated
from flea_diag.tools.campaign.result_log import RESULTS, read_results
from flea_diag.tools.campaign.run_result import RunResult
from flea_diag.wire.bags.bag_layout import refuse_closed
from flea_diag.wire.regular_file import read_text

LARGEST_JSON_BYTES = 64 << 20

Episode = Mapping[str, Any]
"""One episode of a replay's summary, checked by ``_episodes``."""
ABSENT: Episode = {}


@dataclass(frozen=True)
class Decision:
    """Verdict of one run; ``episodes`` are those of a replay's summary, with their evidence."""

    name: str
    outcome: str
    group: tuple[str, ...]
    alarms_s: tuple[float, ...]
    episodes: tuple[Episode, ...] = ()
    digest: str = ""
    decision_digest: str = ""
    backend: str = ""
    right: bool | None = None
    failure: str = ""

    @property
    def verdict(self) -> tuple[Any, ...]:
        """What must be equal for two decisions to be equal."""
        said = [(e["outcome"], sorted(e["ambiguity_group"])) for e in self.episodes]
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


def _of_detail(path: Path) -> tuple[Episode, ...]:
    with _shaped(path):
        detail = migrated("run detail", _json(path), str(path))
        return _episodes(migrated("replay summary", detail["summary"], str(path)))


def _of_summary(summary: Any, path: Path) -> Decision:
    with _shaped(path):
        episodes = _episodes(summary)
        return Decision(
            Path(summary["bag"]).name,
            str(summary["outcome"]),
            tuple(sorted(map(str, summary["ambiguity_group"]))),
            tuple(episode["detected_at_s"] for episode in episodes),
            episodes,
            str(summary["digest"]),
            str(summary.get("decision_digest", "")),
            str(summary.get("backend", "")),
        )


def _episodes(summary: Mapping[str, Any]) -> tuple[Episode, ...]:
    """The compared part of each episode; older files lack evidence and steps."""
    return tuple(
        {
            "outcome": str(row["outcome"]),
            "detected_at_s": float(row["detected_at_s"]),
            "detected_by": str(row.get("detected_by", "")),
            "ambiguity_group": [str(fault) for fault in row["ambiguity_group"]],
            "kept": dict(row.get("kept", {})),
            "dropped": dict(row.get("dropped", {})),
            "steps": [
                {"at_s": float(s["at_s"]), "outcome": str(s["outcome"]), "members": [*s["members"]]}
                for s in row.get("steps", ())
            ],
        }
        for row in summary["episodes"]
    )


@contextmanager
def _shaped(path: Path) -> Iterator[None]:
    """Refuse JSON of another shape."""
    try:
        yield
    except (TypeError, KeyError, ValueError, AttributeError) as error:
        raise RecordingError(
            f"{path}: not the JSON of a replay ({error!r}): write it with flea replay --json"
        ) from error


def _json(path: Path) -> Any:
    try:
        return json.loads(read_text(path, LARGEST_JSON_BYTES))
    except (OSError, ValueError, RecursionError) as error:
        raise RecordingError(f"{path}: cannot be read as JSON: {error}") from error


# --- how two differ -----------------------------------------------------------------------


def differences(a: Decision, b: Decision) -> list[str]:
    """What changed, when, and by which evidence."""
    lines = [f"{a.words()}  ->  {b.words()}"]
    for number, (one, other) in enumerate(zip_longest(a.episodes, b.episodes, fillvalue=ABSENT), 1):
        lines += [f"episode {number}: {line}" for line in _of_episodes(one, other)]
    return lines


def _of_episodes(a: Episode, b: Episode) -> Iterator[str]:
    if ABSENT in (a, b):
        yield f"in {'A' if a else 'B'} only, {_opened(a or b)}"
        return
    if _opened(a) != _opened(b):
        yield f"{_opened(a)}  ->  {_opened(b)}"
    parting = _parting(a["steps"], b["steps"])
    if parting:
        yield parting
    for fault in sorted(set(a["ambiguity_group"]) ^ set(b["ambiguity_group"])):
        yield f"{fault}: A {_held(a, fault)}; B {_held(b, fault)}"


def _opened(episode: Episode) -> str:
    by = episode["detected_by"] or "an unknown residual"
    return f"detected at {episode['detected_at_s']} s by {by}"


def _parting(a: Any, b: Any) -> str:
    """The step at which the two groups first differ."""
    for one, other in zip(a, b, strict=False):
        if (one["outcome"], one["members"]) != (other["outcome"], other["members"]):
            return (
                f"they differ at {one['at_s']} s ({_step(one)}) and {other['at_s']} s "
                f"({_step(other)})"
            )
    longer, which = (a, "A") if len(a) > len(b) else (b, "B")
    rest = longer[min(len(a), len(b)) :]
    return f"{which} continues at {rest[0]['at_s']} s ({_step(rest[0])})" if rest else ""


def _step(step: Mapping[str, Any]) -> str:
    members = step["members"]
    named = ", ".join(members[:4]) + (f" and {len(members) - 4} more" if len(members) > 4 else "")
    return f"{step['outcome']} {{{named}}}"


def _held(episode: Episode, fault: str) -> str:
    if fault in episode["ambiguity_group"]:
        return f"kept it ({episode['kept'].get(fault, 'no reason recorded')})"
    return f"dropped it ({episode['dropped'].get(fault, 'never in the group')})"
