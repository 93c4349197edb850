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

"""Feature requests of one episode: which feature next, on which window, and until when.

The fault feature table was learned on windows in motion with the fault present throughout.
A window therefore begins after the detection and holds motion, with a reversal, which excites
backlash. All features are requested on the same window; if several faults remain after them, they
are requested again on the next window.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from flea_diag.core.choice.feature_choice import FeatureChooser
from flea_diag.core.choice.window_odds import WindowOdds
from flea_diag.core.vibration.nominal_range import FAST_RAD_S, MOVING_RAD_S, NEAR_FASTEST
from flea_diag.stages.isolator.motion_window import MotionWindow
from flea_diag.wire.records import FeatureRequest, FeatureValue

Rules = tuple[tuple[int, float, float], ...]

REVERSAL_NS = 2_000_000_000
"""Time to wait for a window with a reversal: half a period of the slowest usual motion."""
NO_SLOWER = 0.98
"""A window at least this fast relative to the fastest, and accelerating, is not yet the best."""
LOOK_EVERY_NS = 100_000_000
"""Not a multiple of half a second: periodic motions would be sampled at one phase only."""
FASTEST_FIRST: Rules = (
    (0, FAST_RAD_S, 1.0), (REVERSAL_NS, MOVING_RAD_S, NEAR_FASTEST),
    (2 * REVERSAL_NS, 7.0, 0.5),
)  # fmt: skip
"""Windows accepted: waiting time from which the rule holds, least speed (rad/s), and least share
of the fastest window since detection. A jammed shaft often only creeps."""
ANY_MOTION: Rules = ((0, MOVING_RAD_S, 0.0), (2 * REVERSAL_NS, 7.0, 0.0))
RUBBING = frozenset(("jam", "ball_nut_friction"))
"""Isolable from each other in slow motion as well: any motion is accepted for this pair."""


@dataclass
class FeatureQuery:
    """State of the feature requests of one episode.

    Parameters
    ----------
    since_ns : earliest start of a window
    most_windows : number of windows after which the remaining group is final
    """

    since_ns: int
    window_ns: int
    most_windows: int
    request: FeatureRequest | None = None
    wanted: str | None = None
    computed: tuple[str, ...] = ()
    odds: WindowOdds = field(default_factory=WindowOdds)
    _tried: tuple[str, ...] = ()
    _answered: bool = False
    _windows: int = 1
    _until_ns: int = 0
    _end_ns: int | None = None
    _looked_ns: int = 0
    _rules: Rules = FASTEST_FIRST

    def plan(self, group: Mapping[str, float], chooser: FeatureChooser) -> None:
        """Choose the next feature, on this window or on a new one; `wanted` holds it."""
        self._rules = ANY_MOTION if RUBBING.issuperset(group) else FASTEST_FIRST
        self.wanted = chooser.next(self.odds.unbounded(group, chooser.table), self._tried)
        if self.wanted or not self._answered or self._windows >= self.most_windows:
            return
        self.wanted = chooser.next(group)
        if self.wanted:
            self._tried, self._answered = (), False
            self.odds.begin()
            self._windows += 1
            self.since_ns, self._end_ns = self._until_ns, None

    def ask(self, stamp_ns: int, episode: int, step: int) -> FeatureRequest:
        """Request the wanted feature on the window in use, or on the one that ends now."""
        assert self.wanted is not None
        end_ns = self._end_ns = stamp_ns if self._end_ns is None else self._end_ns
        start_ns = end_ns - self.window_ns
        self.request = FeatureRequest(stamp_ns, episode, step, self.wanted, start_ns, end_ns)
        return self.request

    def is_due(self, stamp_ns: int, window: MotionWindow) -> bool:
        """Whether a feature is wanted and a window for it exists."""
        if self.wanted is None or self._end_ns is not None:
            return self.wanted is not None
        waited_ns = stamp_ns - self.window_ns - self.since_ns
        if waited_ns < 0 or not (waited_ns >= REVERSAL_NS or window.reverses):
            return False
        least, share = [taken for after_ns, *taken in self._rules if waited_ns >= after_ns][-1]
        return window.reaches(least) and (
            window.reaches(FAST_RAD_S) or self._is_best(window, share)
        )

    def _is_best(self, window: MotionWindow, share: float) -> bool:
        """Whether a window of slow motion is accepted, as none better is to be expected."""
        if not share:
            return True
        fastest = window.fastest_rad_s(self.since_ns)
        best_to_come = window.rises and window.reaches(NO_SLOWER * fastest)
        return not best_to_come and window.reaches(share * fastest)

    def looks_out(self, stamp_ns: int) -> bool:
        """Whether it is time to look for a window again; records the time."""
        waits = self.wanted is not None and self._end_ns is None and self.request is None
        if not waits or stamp_ns - self._looked_ns < LOOK_EVERY_NS:
            return False
        self._looked_ns = stamp_ns
        return True

    def is_open(self, stamp_ns: int, patience_ns: int) -> bool:
        """Whether an answer or a window is still awaited."""
        late = stamp_ns > self.since_ns + self.window_ns + patience_ns
        return self.request is not None or (self.wanted is not None and not late)

    def take(self, answer: FeatureValue) -> bool:
        """Whether this answers the open request, which it then closes."""
        asked = self.request
        if asked is None or (asked.episode, asked.step) != (answer.episode, answer.step):
            return False
        self.give_up()
        self._answered = True
        if math.isnan(answer.value):
            self._end_ns = None  # next feature on another window: this one may be invalid
            self.odds.begin()
        elif answer.feature not in self.computed:
            self.computed += (answer.feature,)
        return True

    def pass_over(self, feature: str) -> None:
        """Skip a feature whose answer is already known on the first window."""
        self._tried += (feature,)

    def give_up(self) -> None:
        """Close the open request; its feature is not requested again on this window."""
        assert self.request is not None
        self._tried += (self.request.feature,)
        self._until_ns = self.request.window_end_ns
        self.request = None
