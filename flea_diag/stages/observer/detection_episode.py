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

"""The detection side of an episode: opened by the first test above its limit, closed when quiet.

``Episode`` is shared with the isolator; symbols and quiet time belong to the observer.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from flea_diag.core.detection import symbols
from flea_diag.core.detection.detection import TestResults
from flea_diag.core.detection.symbols import SLOPE_S, UNKNOWN, SymbolState
from flea_diag.core.residuals.residual_rows import ResidualSet
from flea_diag.stages.episode import Episode
from flea_diag.stages.observer.condition_watch import Voided
from flea_diag.wire.records import (
    EARLIER_LEVEL,
    NEVER_NS,
    TAKEN_BACK,
    TAKEN_OVER,
    Detection,
    Record,
    Symbol,
    Symbols,
)

Flags = npt.NDArray[np.bool_]
Stamps = npt.NDArray[np.int64]

THAW_S = 30.0
"""Time after a detection from which what has not deviated goes on: a prediction strays by itself
while a housing warms, and so does what is held against a level of before. What a fault heats at
once has shown."""
QUIET = 0.7
"""A test below this share of its limit is quiet."""


class DetectionEpisode:
    """The open episode, if any: its symbols, and for how long all tests have been quiet."""

    def __init__(self, known: ResidualSet, rearm_after_s: float) -> None:
        self._rows, self._isolating = known.rows, known.isolating
        self._every = frozenset(range(len(known.rows)))
        self._wait_ns = rearm_after_s * 1e9
        self._last_number = 0
        self.forget()

    @property
    def is_open(self) -> bool:
        """Whether an episode is open."""
        return self.episode is not None

    def forget(self) -> None:
        """Drop the open episode, if any; numbering continues."""
        self.episode: Episode | None = None
        self._symbols: dict[int, SymbolState] = {}
        self._opened_by: frozenset[int] = frozenset()
        self._quiet_since_ns = NEVER_NS
        self._has_thawed = False

    def _thaws(self, stamps_ns: Stamps) -> Flags:
        """Whether what has not deviated goes on, at each of n scans of the open episode."""
        assert self.episode is not None
        return np.asarray(stamps_ns - self.episode.detected_ns >= THAW_S * 1e9)

    @property
    def goes_on(self) -> frozenset[int]:
        """Columns of the residuals whose predictions and levels go on in the open episode."""
        return self._every.difference(self._symbols) if self._has_thawed else frozenset()

    def take_over(self, opened_ns: int, number: int) -> Detection:
        """Continue an episode opened before this observer was started.

        Slopes are unknown, as the onset was not observed, and quiet does not close it: a deviation
        already present at the restart looks quiet.
        """
        return self._begin(Detection(opened_ns, number, True, "", math.nan, math.nan, TAKEN_OVER))

    def _begin(self, detection: Detection) -> Detection:
        """Open the episode of a detection, whose number joins both sides."""
        self._last_number = detection.episode
        self.episode = Episode.of(detection, detection.episode)
        return detection

    def follow(self, stamps_ns: Stamps, results: TestResults) -> int:
        """Follow n scans; index of the first that causes a record, or n."""
        happens = results.deviating()
        if self.episode is None:
            return _first(np.any(happens, axis=1))
        happens &= self._isolating
        for j, state in self._symbols.items():
            # One without a sign takes the first; every other one stays.
            happens[:, j] &= results.signed(j) if state.magnitude == symbols.ANY else False
        event = np.any(happens, axis=1)
        if not self._has_thawed:
            event |= self._thaws(stamps_ns)
        if self.episode.taken_over:
            return _first(event)
        for j, state in self._symbols.items():
            if state.slope == UNKNOWN and state.magnitude != symbols.ANY:
                due = stamps_ns - state.since_ns >= SLOPE_S * 1e9
                window, k, way = state.test
                same = (results.window[:, j] == window) & (results.k[:, j] == k)
                same &= results.direction(j) == way
                event |= due & same & ~np.isnan(results.z[:, j])
        quiet_ns = self._quiet_ns(stamps_ns, results)
        event |= (quiet_ns >= self._wait_ns) & (self._wait_ns > 0)
        self._quiet_since_ns = int(stamps_ns[-1] - quiet_ns[-1]) if quiet_ns[-1] >= 0 else NEVER_NS
        return _first(event)

    def step(self, stamp_ns: int, results: TestResults) -> tuple[Record, ...]:
        """Records of one scan."""
        deviating = results.deviating()[0]
        if self.episode is None:
            return self._open(stamp_ns, results, deviating) if np.count_nonzero(deviating) else ()
        self._has_thawed = bool(self._thaws(np.array([stamp_ns]))[0])
        before = dict(self._symbols)
        for j in np.flatnonzero(deviating & self._isolating).tolist():
            seen, signed = self._symbols.get(j), j not in results.along
            if seen is None or (signed and seen.magnitude == symbols.ANY):
                self._symbols[j] = symbols.crossed(*results.test(j), stamp_ns, signed)
        if not self.episode.taken_over:
            for j, state in self._symbols.items():
                self._symbols[j] = symbols.later(state, *results.test(j), stamp_ns)
        changed = self._symbols != before
        out: tuple[Record, ...] = (self._symbol_record(stamp_ns),) if changed else ()
        if self.episode.taken_over:
            return out
        quiet_ns = int(self._quiet_ns(np.array([stamp_ns]), results)[0])
        self._quiet_since_ns = stamp_ns - quiet_ns if quiet_ns >= 0 else NEVER_NS
        if 0 < self._wait_ns <= quiet_ns:
            return *out, self.close(stamp_ns, "quiet")
        return out

    def _quiet_ns(self, stamps_ns: Stamps, results: TestResults) -> Stamps:
        """Time (ns) for which all tests had been quiet at each scan; -1 where one is not.

        What has deviated and is tested at rest, too, is not quiet where its reading is refused.
        """
        loud: Flags = np.any(np.abs(results.z) > QUIET * results.k, axis=1) | results.void
        read = [j for j in self._symbols if self._rows[j].gate == "always"]
        loud |= np.isnan(results.z[:, read]).any(axis=1)
        # Quiet time counts from the first quiet scan after one that was not.
        begins = np.append(self._quiet_since_ns < 0, loud[:-1])
        begun = np.where(begins, stamps_ns, self._quiet_since_ns)
        since = np.maximum.accumulate(begun)
        quiet: Stamps = np.where(loud, -1, stamps_ns - since)
        return quiet

    def _open(self, stamp_ns: int, results: TestResults, deviating: Flags) -> tuple[Record, ...]:
        z, k, shift = results.z[0], results.k[0], results.shift[0]
        self._symbols = {
            j: symbols.crossed(*results.test(j), stamp_ns, j not in results.along)
            for j in np.flatnonzero(deviating & self._isolating).tolist()
        }
        self._opened_by = frozenset(np.flatnonzero(deviating).tolist())
        # A shift and its witness deviate together: the shift is reported.
        first = max(
            np.flatnonzero(deviating).tolist(),
            key=lambda j: (float(abs(z[j]) / k[j]), not math.isnan(shift[j])),
        )
        detection = self._begin(
            Detection(
                stamp_ns,
                self._last_number + 1,
                True,
                self._rows[first].name,
                float(z[first]),
                float(k[first]),
                _test(
                    int(results.window[0, first]),
                    float(shift[first]),
                    self._rows[first].unit,
                    results.along[first][0] if first in results.along else "",
                ),
            )
        )
        # An innovation has no symbol: symbols follow once a relation deviates.
        return (detection, self._symbol_record(stamp_ns)) if self._symbols else (detection,)

    def _symbol_record(self, stamp_ns: int) -> Symbols:
        rows = (
            Symbol(self._rows[j].name, state.magnitude, state.slope, state.since_ns)
            for j, state in sorted(self._symbols.items(), key=lambda item: item[1].since_ns)
        )
        return Symbols(stamp_ns, self._last_number, tuple(rows))

    def take_back(self, stamp_ns: int, voided: Voided) -> tuple[Record, ...]:
        """Close a young episode that a condition, which now begins, explains.

        It voids all residuals that the episode rests on, and may have moved them as they moved.
        """
        rests_on = self._opened_by.union(self._symbols)
        if self.episode is None or not rests_on or not rests_on <= voided.columns:
            return ()
        if any((j, state.magnitude) in voided.excludes for j, state in self._symbols.items()):
            return ()
        if stamp_ns - self.episode.detected_ns > voided.takes_back_s * 1e9:
            return ()
        names = ", ".join(self._rows[j].name for j in sorted(rests_on))
        return (self.close(stamp_ns, f"{TAKEN_BACK}: {names} void {voided.words}"),)

    def close(self, stamp_ns: int, why: str) -> Detection:
        """Close the open episode."""
        closed = Detection(stamp_ns, self._last_number, False, "", math.nan, math.nan, why)
        self.forget()
        return closed


def _test(window: int, shift: float, unit: str, along: str) -> str:
    """Description of the test that opens an episode."""
    mean = f"coefficient on {along} of {window} samples" if along else f"mean of {window} samples"
    if math.isnan(shift):
        return mean
    side = "above" if shift > 0.0 else "below"
    return f"{mean}, {abs(shift):.3g} {unit} {side} {EARLIER_LEVEL}"


def _first(event: Flags) -> int:
    """Index of the first true entry, or the number of entries."""
    return int(event.argmax()) if event.any() else len(event)
