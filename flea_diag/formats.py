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

"""The versions of our file formats, and the only place that migrates an older file.

Every kind of file that flea_diag writes or reads carries its version under ``schema_version``.
Whoever writes one calls ``stamped``, whoever reads one calls ``migrated`` before anything else.
A change that older files do not survive raises the version by one and adds a step to it.

Not listed: bags (rosbag2's format, with a version of its own), the verdict that a diagnoser keeps
for its next start (a message of its topic) and the digest of a campaign's plan (one line).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from flea_diag.errors import (
    CalibrationError,
    ConfigurationError,
    InputError,
    RecordingError,
    shown,
)

KEY = "schema_version"

Step = Callable[[Mapping[str, Any]], Mapping[str, Any]]
"""Content of version n -> content of version n + 1.

It is given what somebody wrote, unchecked: what is not as it should be it leaves as it is, for
the reader to refuse. It changes nothing in place.
"""


@dataclass(frozen=True)
class Format:
    """One kind of file.

    Parameters
    ----------
    version
        Version that is written now.
    remedy
        What to do with a file that is too old.
    error
        What a file that cannot be used raises.
    steps
        Version n -> step to n + 1; together they lead from the oldest readable version to
        ``version`` without a gap.
    unversioned
        Version of a file without the key; None where every release wrote one.
    """

    version: int
    remedy: str
    error: type[InputError] = ConfigurationError
    steps: Mapping[int, Step] = field(default_factory=dict)
    unversioned: int | None = None

    @property
    def oldest(self) -> int:
        """The oldest version that can be read."""
        return min(self.steps, default=self.version)


def _unchanged(content: Mapping[str, Any]) -> Mapping[str, Any]:
    """Step to a version whose new entries an older file may lack."""
    return content


def _of_unknown_origin(content: Mapping[str, Any]) -> Mapping[str, Any]:
    """Summaries did not say when, at which commit and by which seed their runs were made."""
    return {"dates": [], "commits": [], **content}


def _upper_part(content: Mapping[str, Any]) -> Mapping[str, Any]:
    """Feature tables called the upper part of the range ``0+``, it is ``0^`` since."""
    alphabet = content.get("alphabet")
    if not isinstance(alphabet, list) or "0+" not in alphabet:
        return content
    renamed = dict(content)
    renamed["alphabet"] = ["0^" if symbol == "0+" else symbol for symbol in alphabet]
    for section in ("faults", "unaffected"):
        if section in renamed:
            renamed[section] = _renamed(renamed[section], "0+", "0^")
    return renamed


def _renamed(value: Any, old: str, new: str) -> Any:
    """The same with a word renamed wherever it stands alone, as a key or as an entry."""
    if isinstance(value, Mapping):
        return {_renamed(k, old, new): _renamed(v, old, new) for k, v in value.items()}
    return new if value == old else value


_FIRST: Mapping[int, Step] = {0: _unchanged}
_REPLAY = "make it with flea replay --json"
_EVALUATE = "evaluate again"

FORMATS: Mapping[str, Format] = {
    # What the diagnosis rests on.
    "stand": Format(1, "write it anew after config/stands/flea/stand.yaml"),
    "channel mapping": Format(1, "write it anew as docs/your_stand.md says"),
    "actuator description": Format(1, "write it anew after config/stands/flea/actuator.yaml"),
    "fault catalogue": Format(1, "write it anew after config/stands/flea/faults.yaml"),
    "feature table": Format(
        1, "learn it again with flea features learn", steps={0: _upper_part}, unversioned=0
    ),
    "calibration": Format(
        2, "calibrate again with flea calibrate", CalibrationError, {1: _unchanged}
    ),
    "stand template": Format(1, "write it anew after config/templates/dc_screw.yaml"),
    "classifier": Format(1, "train it again with flea features train"),
    "language": Format(1, "write it anew after config/languages/de.yaml"),
    # What runs are made of.
    "scenario": Format(1, "write it anew after config/scenarios", steps=_FIRST, unversioned=0),
    "machine": Format(1, "write it anew after config/machines/flea.yaml"),
    "campaign": Format(1, "write it anew after config/campaigns"),
    # What came of them.
    "run result": Format(1, _EVALUATE, RecordingError),
    "run detail": Format(1, _EVALUATE, RecordingError, _FIRST, unversioned=0),
    "run trace": Format(1, _EVALUATE, RecordingError),
    "evaluation summary": Format(2, _EVALUATE, RecordingError, {1: _of_unknown_origin}),
    "replay summary": Format(1, _REPLAY, RecordingError),
    "comparison": Format(1, "compare again with flea diff", RecordingError),
    "trend": Format(1, "make it again with flea trend", RecordingError),
    "feature study": Format(2, "make it again with flea features study", RecordingError),
    "realism report": Format(1, "make it again with flea realism", RecordingError),
    # What a stand keeps.
    "clip index": Format(1, "read the clips themselves", RecordingError, _FIRST, unversioned=0),
    "alarm journal": Format(1, "name another journal", steps=_FIRST, unversioned=0),
}


def stamped(kind: str, content: Mapping[str, Any]) -> dict[str, Any]:
    """Content of a new file of this kind, its version first."""
    return {KEY: FORMATS[kind].version, **content}


def migrated(kind: str, content: object, where: str) -> dict[str, Any]:
    """Content of a file of this kind as the current version has it, without its version.

    Parameters
    ----------
    kind
        Key of ``FORMATS``.
    content
        What the file held; it stays as it is.
    where
        Name of the file, for messages.

    Raises
    ------
    InputError
        The error of this kind, in one line: no mapping, no version, no whole number, newer than
        this release, or older than any that it migrates.
    """
    known = FORMATS[kind]
    if not isinstance(content, Mapping):
        raise known.error(f"{where}: {kind} must be a mapping, not {_kind_of(content)}")
    found = _found(kind, content, where)
    current: Mapping[str, Any] = content
    for version in range(found, known.version):
        current = known.steps[version](current)
    return {key: value for key, value in current.items() if key != KEY}


def _kind_of(content: object) -> str:
    """What a file holds instead of a mapping, without a word of it: it may be no file of ours."""
    kinds = {str: "a text", list: "a list", type(None): "empty"}
    return kinds.get(type(content), "a single value")


def _found(kind: str, content: Mapping[str, Any], where: str) -> int:
    """Version of a file, of those that can be read."""
    known = FORMATS[kind]
    found = content.get(KEY, known.unversioned)
    reads = f"this flea_diag reads {_range(known)}"
    if found is None and KEY not in content:
        raise known.error(f"{where}: {kind} has no {KEY}, {reads}: {known.remedy}")
    said = f"{where}: {kind} has {KEY} = {shown(found)}"
    if type(found) is not int:
        raise known.error(f"{said}, it must be a whole number, {reads}: {known.remedy}")
    if found > known.version:
        raise known.error(f"{said}, {reads}: made by a newer flea_diag, update this one")
    if found < known.oldest:
        raise known.error(f"{said}, {reads}: {known.remedy}")
    return found


def _range(known: Format) -> str:
    several = known.oldest != known.version
    return f"{known.oldest} to {known.version}" if several else str(known.version)
