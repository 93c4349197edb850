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

"""The wiring of the channels of one stream: looked at in its first motion, and said."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from flea_diag.core.scan_counts import ScanCounts
from flea_diag.core.wiring.wiring_search import WiringFinding, WiringSearch
from flea_diag.core.wiring.wiring_watch import WiringWatch
from flea_diag.wire.records import NEVER_NS, WIRING, ChannelQuality, Quality

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Stamps = npt.NDArray[np.int64]

LOOKED_AT = "whether the wiring of a channel explains it is being looked at"
WIRED_WRONG = "wired wrong"


class StreamWiring:
    """Rows of DataQuality about the wiring of one stream."""

    def __init__(self, search: WiringSearch, counts: ScanCounts, period_s: float) -> None:
        self._watch = WiringWatch(search, counts, period_s)
        self._period_s = period_s
        self._since_ns = NEVER_NS
        self._said: tuple[bool, WiringFinding | None] = (False, None)

    def close(self) -> None:
        """Look at no more: this is not the start of a stream."""
        self._watch.close()

    def again(self, stamp_ns: int, deviates: bool) -> None:
        """Look anew, where something was found: it may have been mended."""
        if self._watch.finding is None:
            return
        self._watch.begin()
        if deviates:
            self._watch.deviates(stamp_ns)

    def follow(self, stamps_ns: Stamps, raw: Array, usable: Array, moving: Flags) -> int:
        """Take n scans; the first at which ``step`` has something to look at, or n."""
        return self._watch.take(stamps_ns, raw, usable, moving)

    def step(self, stamp_ns: int, opens: bool) -> bool:
        """Whether what is said changes with this scan, which ``follow`` has taken.

        ``opens``: an episode begins with it.
        """
        if opens:
            self._watch.deviates(stamp_ns)
        if self._watch.due:
            self._watch.decide()
        before, self._said = self._said, (self._watch.waits, self._watch.finding)
        if self._said != before:
            self._since_ns = stamp_ns
        return self._said != before

    def states(self) -> tuple[ChannelQuality, ...]:
        """The row of the wiring, where there is something to say of it."""
        found = self._watch.finding
        if found is not None:
            quality = Quality.BAD if found.is_sure else Quality.SATURATED
            return (ChannelQuality(WIRING, quality, self._since_ns, self._words(found)),)
        if self._watch.waits:
            return (ChannelQuality(WIRING, Quality.GOOD, self._since_ns, LOOKED_AT),)
        return ()

    def marked(self, rows: Sequence[ChannelQuality]) -> tuple[ChannelQuality, ...]:
        """Rows of channels, those that are wired wrong for sure as bad."""
        found = self._watch.finding
        if found is None or not found.is_sure:
            return tuple(rows)
        wrong = {name for fault in found.faults for name in fault.channels}
        since_ns, words = self._since_ns, self._words(found)
        return tuple(
            replace(row, quality=Quality.BAD, since_ns=since_ns, reason=words)
            if row.channel in wrong
            else row
            for row in rows
        )

    def _words(self, found: WiringFinding) -> str:
        """What is wrong, by what it shows, and what to do about it."""
        what = " or ".join(fault.words(self._period_s) for fault in found.faults)
        remedies = dict.fromkeys(fault.remedy for fault in found.faults)
        shows = f"{found.residual} is at {found.share:.3g} times its limit"
        mended = f"without that every relation is within {found.left:.0%} of its limit"
        return f"{WIRED_WRONG}: {what}; {shows}, {mended}: {', or '.join(remedies)}"
