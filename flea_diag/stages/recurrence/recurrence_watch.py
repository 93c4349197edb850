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

"""Watches for faults that come and go, over all episodes and between them.

An episode is a deviation that lasts. What lasts for a tenth of a second and comes again opens none,
or one whose evidence is mostly of a healthy machine. So the windows since something was first far
out are kept here, and weighed anew each time that a burst is over.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from flea_diag.core.evidence.stream_windows import LawScans, LawWindowMeans
from flea_diag.core.likelihood.fit import Fit, KnownErrors
from flea_diag.core.recurrence.occurrence import gathered, most_times, rhythm
from flea_diag.core.recurrence.recurring import (
    FAR,
    NEAR,
    SHOWS,
    RecurringFault,
    bursts,
    recurring,
)
from flea_diag.core.recurrence.stream_rows import StreamRows
from flea_diag.core.recurrence.watched_windows import WatchedWindow, WatchedWindows
from flea_diag.core.run_law.run_windows import PLACE, WINDOW_S, zeroed
from flea_diag.stages.recurrence.recurrence_knowledge import RecurrenceKnowledge
from flea_diag.stages.recurrence.waiting_scans import WaitingScans
from flea_diag.wire.blocks import ResidualBlock
from flea_diag.wire.records import NEVER_NS, Recurrence, Residual, UnitOffset

Array = npt.NDArray[np.float64]
Offsets = tuple[UnitOffset, ...]

KEPT_WINDOWS = 600
"""Two minutes: so much is weighed together, and remembered for a burst to come again."""
OVER_WINDOWS = 2
"""Quiet windows after which a burst is over."""
MERGED_AFTER, MERGED_WINDOWS = 25, 50
"""What comes again too soon is one burst that is never over, and its gaps are shorter than windows:
after 5 s, and twice as long each time in vain, the last 10 s are looked at moment by moment."""
GAP_NS = 1_000_000_000
"""After a gap this long the stream begins anew."""
SHARE = 0.15
"""Of the evidence of the best: what is left of a smoothed burst no model gives more exactly."""


@dataclass(frozen=True)
class ComesAndGoes:
    """Faults that come and go, the most likely first, each with its fit, and when they came.

    Without a fault it is over.
    """

    fits: Mapping[str, Fit]
    told: Recurrence


class RecurrenceWatch:
    """Takes every residual of a stream, one by one or in blocks, with the same result."""

    def __init__(self, knowledge: RecurrenceKnowledge, drop_nats: float) -> None:
        self._k, self._drop_nats = knowledge, drop_nats
        self._last_ns = NEVER_NS
        self.forget()

    def forget(self) -> None:
        """A new stream, or another unit: nothing so far counts."""
        self._waiting = WaitingScans(self._k.scans, self._k.position)
        self._offsets: Offsets = ()
        self._source, self._names = self._k.columns(), tuple[str, ...]()
        self._windows: LawWindowMeans | None = None
        self._begun: list[LawScans] = []
        """Scans of a window that has begun."""
        self._jump: Array | None = None
        """By how much each reading has jumped so far in a window that has begun; None: none has."""
        self._rows = StreamRows(self._k.hypotheses, np.array(self._k.fast))
        self._arm()

    def rearm(self) -> None:
        """What was found is over."""
        self._settle()
        self._arm()

    def _arm(self) -> None:
        k = self._k
        self._history = WatchedWindows(k.hypotheses, np.array(k.fast), k.load, KEPT_WINDOWS)
        self._quiet, self._due = 0, False
        self._lasts, self._patience = 0, MERGED_AFTER
        self._before: Recurrence | None = None
        """What fell out of the history."""
        self._latest: RecurringFault | None = None
        self._told_last: Recurrence | None = None

    def step(
        self, record: Residual, offsets: Offsets, stopped: bool = False
    ) -> ComesAndGoes | None:
        """Take one scan.

        ``offsets``: what is known of this unit's zeros; ``stopped``: whether it is in contact with
        a stop, where no channel need tell the place.
        """
        if stopped:
            record = replace(record, values=(math.nan,) * len(record.values))
        self._begin(record.stamp_ns, offsets)
        self._last_ns = record.stamp_ns
        self._waiting.add(record)
        if not self._completes():
            return None
        return next((found for _, found in self._take(self._waiting.taken())), None)

    def take(
        self, block: ResidualBlock, offsets: Offsets, stopped: bool = False
    ) -> Iterator[tuple[int, ComesAndGoes]]:
        """Take n scans; yields how many have been taken when something is found, and what."""
        if not len(block):
            return
        if stopped:
            block = replace(block, values=np.full_like(block.values, math.nan))
        self._begin(int(block.stamps_ns[0]), offsets)
        self._last_ns = int(block.stamps_ns[-1])
        before = len(self._waiting)
        self._waiting.extend(block)
        if not self._completes():
            return
        for taken, found in self._take(self._waiting.taken()):
            yield taken - before, found

    def _completes(self) -> bool:
        """Whether there are windows that may show something.

        Nothing is found before a burst is over. So while none has begun, as many windows are made
        together as that takes, which costs little more than one.
        """
        return self._waiting.complete(1 if len(self._history) else 1 + OVER_WINDOWS)

    def _settle(self) -> None:
        """Make the windows that are whole: what comes next is not to change them."""
        if self._waiting.complete():
            found = next(self._take(self._waiting.taken()), None)
            assert found is None, "something was found before its burst was over"

    def _begin(self, stamp_ns: int, offsets: Offsets) -> None:
        if self._last_ns != NEVER_NS and not 0 < stamp_ns - self._last_ns <= GAP_NS:
            self.forget()
        if offsets != self._offsets:
            self._settle()
            self._offsets = offsets
            self._rows.forget()

    def _take(self, block: ResidualBlock) -> Iterator[tuple[int, ComesAndGoes]]:
        """Take scans that complete a window."""
        if self._windows is None:
            self._names = block.regressor_names
            self._windows = self._source.means(self._names)
        scans, count = self._source.scans(block), self._k.scans
        end, windows = self._windows.together(scans)
        ends = np.arange(end, len(block), count)
        every = LawScans.joined([*self._begun, scans])
        self._begun = [every.part(slice(len(ends) * count, None))] if len(every) % count else []
        jumps = self._leaps(block, ends)
        places = block.regressors[ends, block.regressor_names.index(PLACE)]
        rows = self._rows.add(windows)
        for number, far in enumerate(rows.farthest.tolist()):
            if not (len(self._history) or far > FAR):
                continue
            stamp_ns = int(block.stamps_ns[ends[number]])
            window = WatchedWindow(
                stamp_ns, rows.one(number), jumps[number], float(places[number]),
                every.part(slice(number * count, (number + 1) * count)),
            )  # fmt: skip
            found = self._window(window, far)
            if found is not None:
                yield int(ends[number]) + 1, found

    def _leaps(self, block: ResidualBlock, ends: npt.NDArray[np.int64]) -> Array:
        """By how much each reading jumps in each window at most, shape (windows, readings)."""
        columns = [n for n, name in enumerate(block.regressor_names) if name.startswith("jump_")]
        sizes = np.abs(zeroed(block.regressors[:, columns]))
        begins = [0, *(ends + 1).tolist()]
        if begins[-1] == len(sizes):
            begins.pop()
        most = np.maximum.reduceat(sizes, begins, axis=0)
        if self._jump is not None:
            most[0] = np.maximum(most[0], self._jump)
        self._jump = most[-1] if len(begins) > len(ends) else None
        return np.asarray(most[: len(ends)])

    def _window(self, window: WatchedWindow, farthest: float) -> ComesAndGoes | None:
        """Take one window that is kept."""
        kept = self._history
        kept.add(window)
        self._quiet = self._quiet + 1 if farthest <= NEAR else 0
        self._due |= farthest > (FAR if self._told_last is None else SHOWS)
        self._lasts = self._lasts + 1 if self._due else 0
        found = None
        if self._lasts >= self._patience:
            found = self._weighed(MERGED_WINDOWS)
            self._lasts, self._patience = 0, MERGED_AFTER if found else 2 * self._patience
        if self._due and self._quiet >= OVER_WINDOWS:
            self._due = False
            found = self._weighed() or found
        if len(kept) >= KEPT_WINDOWS:
            return self._trim() or found
        return found

    def _trim(self) -> ComesAndGoes | None:
        """Forget the older half, but for how often something came in it; whether it is over."""
        kept, cut, found, told = self._history, KEPT_WINDOWS // 2, self._latest, self._told_last
        if not bursts(kept.part().far[cut:]):
            self.rearm()
            return None if told is None else ComesAndGoes({}, told)
        if found is not None and told is not None:
            self._before = self._occurrence(found, cut)
        kept.drop(cut)
        self._latest = None
        return None

    def _weighed(self, last: int = 0) -> ComesAndGoes | None:
        """What comes and goes in the windows that are kept; None where nothing does.

        ``last``: it is told by the moments of so many windows; 0: by all windows.
        """
        k, kept, prior = self._k, self._history, self._k.hypotheses.signatures.prior
        moments = k.moments if last else 1
        part = kept.moments(last, self._parted()) if last else kept.part()
        readings = [number for _, number in k.faults]
        every = recurring(part, prior, np.array(k.usable), readings, moments)
        if not every:
            return None
        limit = max(self._drop_nats, SHARE * every[0].nats)
        fits: dict[str, Fit] = {}
        for each in every:
            if each.nats >= every[0].nats - limit:
                fits.setdefault(k.faults[each.model][0], self._fit(each))
        self._latest = every[0]
        told = self._told_last = self._occurrence(every[0], len(kept))
        return None if told is None else ComesAndGoes(fits, told)

    def _parted(self) -> LawWindowMeans:
        """What makes the moments of windows that follow each other."""
        return self._source.means(self._names, self._k.scans // self._k.moments)

    def _fit(self, found: RecurringFault) -> Fit:
        """Evidence of a fault, and its size where bursts are long enough to show it."""
        k = self._k
        model = k.hypotheses.signatures.models[found.model]
        count = len(model.sizes)
        unknown = (math.nan,) * count
        sizes = tuple(found.size[:count].tolist()) if found.whole else unknown
        sigmas = tuple(found.sigma[:count].tolist()) if found.whole else unknown
        return Fit(model.fault, found.nats, sizes, KnownErrors(sigmas))

    def _occurrence(self, found: RecurringFault, windows: int) -> Recurrence | None:
        """When and where it came in so many windows, with what fell out of the history."""
        k, kept, before = self._k, self._history, self._before
        each, moment_s = k.moments, WINDOW_S / k.moments
        seen = kept.presence(windows, self._parted(), found.model, found.size, moment_s)
        came = seen.comings
        if not len(came):
            return before
        behind_s = (each - 0.5 - came % each) * moment_s + k.delay_s
        ends_ns = np.array([kept.end_ns(place) for place in (came // each).tolist()])
        times_ns = (ends_ns - np.round(behind_s * 1e9).astype(np.int64)).tolist()
        places = kept.places(windows).repeat(each)
        there_s, gone_s = (
            float((seen.shows & state).sum()) * moment_s for state in (seen.there, ~seen.there)
        )
        # Smoothing lengthens each burst by as much as a kernel.
        present_s = max(there_s - 2.0 * k.delay_s * len(came), 0.0)
        absent_s = gone_s + there_s - present_s
        unseen_s = float((~seen.shows[came[0] :]).sum()) * moment_s
        count, first_ns = len(came), times_ns[0]
        if before is not None:
            count, first_ns = count + before.count, before.first_ns
            present_s, absent_s = present_s + before.present_s, absent_s + before.absent_s
            unseen_s += before.unseen_s
        return Recurrence(
            count=count,
            first_ns=first_ns,
            last_ns=times_ns[-1],
            present_s=present_s,
            absent_s=absent_s,
            shortest_s=2.0 * k.delay_s,
            every_s=rhythm(np.array(times_ns) / 1e9),
            place=gathered(places[came], places[seen.shows]),
            place_unit=k.place_unit,
            unseen_s=unseen_s,
            most=most_times(count, present_s + absent_s, unseen_s),
        )
