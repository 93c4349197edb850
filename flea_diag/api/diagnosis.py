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

"""What a diagnosis says: outcome, possible faults, episodes, residuals and evidence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from flea_diag.api import result_tables
from flea_diag.api.table import Table
from flea_diag.wire.records import AmbiguityGroup, Candidate, Detection, NextTest

if TYPE_CHECKING:
    from flea_diag.wire.blocks import ResidualBlock
    from flea_diag.wire.records import Truth


@dataclass(frozen=True)
class PossibleFault:
    """One fault that the evidence leaves possible.

    Parameters
    ----------
    fault
        Its name in the catalogue (``jam``).
    probability
        Share among the possible faults, 0 to 1; NaN where nothing weighs them.
    size, size_sigma, size_unit
        Fitted size with its standard error, in ``size_unit``; NaN where none can be fitted.
    hypothesis
        The parameter that deviates and its direction (``friction+``).
    reason
        Latest evidence in words.
    """

    fault: str
    probability: float
    size: float
    size_sigma: float
    size_unit: str
    hypothesis: str
    reason: str


@dataclass(frozen=True)
class EpisodeResult:
    """One episode: from the test that detected it to the last verdict on it.

    Parameters
    ----------
    number
        From 1 on.
    outcome
        Last outcome, such as ``ISOLATED``.
    group
        Possible faults, the most probable first.
    dropped
        Fault that was ruled out -> the reason.
    detected_at_s, settled_at_s
        Seconds after the first scan: of the detection, and since when the last verdict stands.
    detected_by
        The residual or test that opened it.
    words
        The verdict as the console shows it.
    """

    number: int
    outcome: str
    group: tuple[PossibleFault, ...]
    dropped: Mapping[str, str]
    detected_at_s: float
    settled_at_s: float
    detected_by: str
    words: str


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis:
    """The whole result of ``fd.diagnose``.

    Parameters
    ----------
    name
        Of the recording.
    summary
        What ``flea replay --json`` writes, as plain values; times in seconds after the first scan.
    groups
        Every verdict, in order.
    detections
        Every fault flag that was raised or cleared, in order.
    blocks
        Residuals, in order; empty where they were not kept.
    truth
        What the source knows; no stage has read it.
    start_ns
        Stamp of the first scan in nanoseconds.
    """

    name: str
    summary: Mapping[str, Any]
    groups: tuple[AmbiguityGroup, ...]
    detections: tuple[Detection, ...]
    blocks: tuple[ResidualBlock, ...]
    truth: tuple[Truth, ...]
    start_ns: int

    @property
    def outcome(self) -> str:
        """Outcome of the last episode, or of the end where there was none; "" without a verdict."""
        if self.episodes:
            return self.episodes[-1].outcome
        return str(self.summary["outcome"] or "")

    @property
    def group(self) -> tuple[PossibleFault, ...]:
        """Possible faults of the last episode, the most probable first; empty without one."""
        return self.episodes[-1].group if self.episodes else ()

    @property
    def words(self) -> str:
        """The last verdict in words."""
        if self.episodes:
            return self.episodes[-1].words
        return self.groups[-1].words if self.groups else ""

    @cached_property
    def episodes(self) -> tuple[EpisodeResult, ...]:
        """Every episode, in order; times in seconds after the first scan."""
        last = {group.episode: group for group in self.groups if group.episode > 0}
        told = {each["episode"]: each for each in self.summary["episodes"]}
        return tuple(
            EpisodeResult(
                number,
                group.outcome.value,
                possible(group),
                {each.fault: each.reason for each in group.dropped},
                told[number]["detected_at_s"],
                told[number]["settled_at_s"],
                group.opened_by,
                group.words,
            )
            for number, group in last.items()
        )

    @property
    def not_observable(self) -> Mapping[str, str]:
        """Fault that could not be seen in this run -> why."""
        return {row["fault"]: row["reason"] for row in self.summary["not_observable"]}

    @property
    def looked_for(self) -> tuple[str, ...]:
        """Faults that the last verdict has looked for: those that would have been found then."""
        return tuple(self.summary["looked_for"])

    @property
    def judged(self) -> tuple[Mapping[str, Any], ...]:
        """Each test, those not judged first: ``test``, ``judged``, and why not all.

        ``last_10_s`` and ``run`` are the shares of the scans, 0 to 1, in which it had something to
        judge; ``cause`` and ``why`` are None where that were all of the last 10 s.
        """
        return tuple(self.summary["judged"])

    @property
    def to_do(self) -> Mapping[str, str]:
        """What people do about it, as the catalogue states: run, urgency, part, procedure.

        Empty where nothing is to be done, or the catalogue does not say.
        """
        return dict(self.groups[-1].to_do) if self.groups else {}

    @property
    def next_tests(self) -> tuple[NextTest, ...]:
        """Tests that would split the group, the best first; with durations in seconds."""
        return self.groups[-1].next_tests if self.groups else ()

    @property
    def digest(self) -> str:
        """SHA-256 over all that was decided; equal for equal input and numeric backend."""
        return str(self.summary["digest"])

    @cached_property
    def residuals(self) -> Table:
        """Residuals over time: ``NAME``, ``NAME/z`` and ``NAME/limit`` for each, shape (scans,).

        ``NAME`` is in the unit of its equation, ``z`` in standard deviations, ``limit`` what
        a test lets z reach either way. NaN where a residual is not formed (bad channel, no motion).

        Raises
        ------
        ConfigurationError
            They were not kept (``residuals=False``).
        """
        return result_tables.residuals(self._told)

    @cached_property
    def verdicts(self) -> Table:
        """Verdicts over time, one row a change: outcome, episode, members, probabilities, words.

        ``time_s`` is in seconds after the first scan; members and probabilities are joined by
        spaces, the most probable first.
        """
        return result_tables.verdicts(self._told)

    @cached_property
    def evidence(self) -> Table:
        """Why each fault is possible or ruled out, one row an observation.

        ``time_s`` is in seconds after the first scan; ``possible`` is 1 or 0; ``source``,
        ``observed``, ``predicted`` and ``verdict`` are words.
        """
        return result_tables.evidence(self._told)

    @property
    def _told(self) -> result_tables.Told:
        return result_tables.Told(self.name, self.start_ns, self.groups, self.blocks)

    def plot(self, residuals: Sequence[str] = ()) -> Any:
        """Residuals with their limits over time, and the group with its probabilities.

        Parameters
        ----------
        residuals
            Names of those to draw; by default the four furthest beyond their limits.

        Returns
        -------
        matplotlib.figure.Figure
            A notebook shows it; ``savefig`` writes it. Times in seconds, residuals as z.

        Raises
        ------
        ConfigurationError
            matplotlib is not installed, residuals were not kept, or a name is unknown.
        """
        from flea_diag.api.picture import picture

        title = f"{self.name}: {self.outcome or 'no verdict'}"
        detected_s = [episode.detected_at_s for episode in self.episodes]
        bars = [(row.fault, row.probability) for row in self.group]
        return picture(title, self.residuals, tuple(residuals), detected_s, bars)

    def __repr__(self) -> str:
        """What ``flea replay`` prints."""
        from flea_diag.tools.replay.summary import in_words

        return in_words({**self.summary, "bag": self.name})

    def _repr_html_(self) -> str:
        """Outcome, group and episodes, for a notebook."""
        from flea_diag.api.page import page

        return page(self.name, self.outcome, self.words, self.episodes, self.not_observable)


def possible(group: AmbiguityGroup) -> tuple[PossibleFault, ...]:
    """Members of a verdict, in its order."""
    return tuple(map(_possible, group.members))


def _possible(row: Candidate) -> PossibleFault:
    reason = row.reason
    if row.evidence:
        last = row.evidence[-1]
        reason = f"{last.source}: observed {last.observed}, predicted {last.predicted}"
    return PossibleFault(
        row.fault, row.probability, row.size, row.size_sigma, row.size_unit, row.hypothesis, reason
    )
