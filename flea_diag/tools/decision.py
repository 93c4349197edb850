"""What was decided of one run, from an evaluation or a replay, and how two of them differ."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from flea_diag.errors import RecordingError
from flea_diag.tools.result_log import RESULTS, read_results
from flea_diag.tools.run_result import RunResult

LARGEST_JSON_BYTES = 64 << 20


@dataclass(frozen=True)
class Decision:
    """Verdict of one run; ``episodes`` are those of a replay's summary, with their evidence."""

    name: str
    outcome: str
    group: tuple[str, ...]
    alarms_s: tuple[float, ...]
    episodes: tuple[Mapping[str, Any], ...] = ()
    digest: str = ""
    backend: str = ""
    right: bool | None = None
    failure: str = ""

    @property
    def verdict(self) -> tuple[Any, ...]:
        """What must be equal for two runs to be decided alike."""
        said = [(e.get("outcome"), sorted(e.get("ambiguity_group", ()))) for e in self.episodes]
        return self.outcome, self.group, self.alarms_s, said, bool(self.failure)

    def words(self) -> str:
        """The verdict in a few words."""
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
        There is neither, or it cannot be read.
    """
    if path.is_dir() or path.suffix == ".jsonl":
        folder = path if path.is_dir() else path.parent
        if path.is_dir() and not (path / RESULTS).is_file():
            found = _of_files(sorted(path.glob("*.json")))
            if found:
                return found
            raise RecordingError(f"{path}: no {RESULTS} and no replay's JSON in it")
        return {each.name: each for each in _of_results(read_results(path), folder)}
    return _of_files([path])


def _of_files(paths: list[Path]) -> dict[str, Decision]:
    found: dict[str, Decision] = {}
    for path in paths:
        content = _json(path)
        for summary in content if isinstance(content, list) else [content]:
            decision = _of_summary(summary, str(path))
            found[decision.name] = decision
    return found


def _of_results(results: tuple[RunResult, ...], folder: Path) -> Iterator[Decision]:
    for result in results:
        name = "/".join(part for part in (result.configuration, result.id, result.fold) if part)
        episodes: tuple[Mapping[str, Any], ...] = ()
        if result.detail and (folder / result.detail).is_file():
            episodes = tuple(_json(folder / result.detail)["summary"]["episodes"])
        yield Decision(
            name,
            result.outcome,
            tuple(sorted(result.group)),
            result.alarms_s,
            episodes,
            result.digest,
            result.backend,
            result.right,
            result.failure,
        )


def _of_summary(summary: Any, where: str) -> Decision:
    try:
        episodes = tuple(summary["episodes"])
        return Decision(
            Path(summary["bag"]).name,
            str(summary["outcome"]),
            tuple(sorted(summary["ambiguity_group"])),
            tuple(episode["detected_at_s"] for episode in episodes),
            episodes,
            summary["digest"],
            summary.get("backend", ""),
        )
    except (TypeError, KeyError) as error:
        raise RecordingError(
            f"{where}: not the JSON of a replay ({error!r}): make it with flea replay --json"
        ) from error


def _json(path: Path) -> Any:
    try:
        if path.stat().st_size > LARGEST_JSON_BYTES:
            raise RecordingError(f"{path}: larger than {LARGEST_JSON_BYTES} bytes, it is not read")
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise RecordingError(f"{path}: cannot be read as JSON: {error}") from error


# --- how two differ -----------------------------------------------------------------------


def differences(a: Decision, b: Decision) -> list[str]:
    """Lines that say what changed, when, and by which evidence."""
    lines = [f"{a.words()}  ->  {b.words()}"]
    for number, (one, other) in enumerate(_paired(a, b), 1):
        lines += [f"episode {number}: {line}" for line in _of_episodes(one, other)]
    return lines


Episode = Mapping[str, Any]


def _paired(a: Decision, b: Decision) -> Iterator[tuple[Episode | None, Episode | None]]:
    for k in range(max(len(a.episodes), len(b.episodes))):
        yield (
            a.episodes[k] if k < len(a.episodes) else None,
            b.episodes[k] if k < len(b.episodes) else None,
        )


def _of_episodes(a: Episode | None, b: Episode | None) -> Iterator[str]:
    if a is None or b is None:
        there, which = (b, "B") if a is None else (a, "A")
        yield f"in {which} alone, {_opened(there or {})}"
        return
    if _opened(a) != _opened(b):
        yield f"{_opened(a)}  ->  {_opened(b)}"
    parting = _parting(a.get("steps", ()), b.get("steps", ()))
    if parting:
        yield parting
    for fault in sorted(set(a["ambiguity_group"]) ^ set(b["ambiguity_group"])):
        yield f"{fault}: A {_held(a, fault)}; B {_held(b, fault)}"


def _opened(episode: Episode) -> str:
    return (
        f"detected at {episode.get('detected_at_s')} s by "
        f"{episode.get('detected_by') or 'what is not known'}"
    )


def _parting(a: Any, b: Any) -> str:
    """Where the two groups first go different ways."""
    for one, other in zip(a, b, strict=False):
        if (one["outcome"], one["members"]) != (other["outcome"], other["members"]):
            return (
                f"they part at {one['at_s']} s ({_step(one)}) and {other['at_s']} s "
                f"({_step(other)})"
            )
    longer, which = (a, "A") if len(a) > len(b) else (b, "B")
    rest = longer[min(len(a), len(b)) :]
    return f"{which} goes on at {rest[0]['at_s']} s ({_step(rest[0])})" if rest else ""


def _step(step: Mapping[str, Any]) -> str:
    members = step["members"]
    named = ", ".join(members[:4]) + (f" and {len(members) - 4} more" if len(members) > 4 else "")
    return f"{step['outcome']} {{{named}}}"


def _held(episode: Episode, fault: str) -> str:
    if fault in episode["ambiguity_group"]:
        return f"kept it ({episode.get('kept', {}).get(fault, 'no reason written')})"
    return f"dropped it ({episode.get('dropped', {}).get(fault, 'never considered')})"
