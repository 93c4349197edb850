"""What an episode asks of vibration: which feature next, on which window, and how long.

What a fault does to a feature was learned on windows in motion with the fault there throughout.
So a window begins after the detection and holds motion, with a reversal, in which play shows.
All features are asked of the same window; when they are used up and several faults are left,
they are asked for anew on the next.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field

from flea_diag.core.feature_choice import FeatureChooser
from flea_diag.core.features_motion import reverses
from flea_diag.core.nominal_range import MOVING_RAD_S
from flea_diag.wire.records import FeatureRequest, FeatureValue

REVERSAL_NS = 2_000_000_000
"""So long a window with a reversal is waited for; half a period of the slowest usual motion."""
RUBBING = frozenset(("jam", "ball_nut_friction"))
CREEPING_RAD_S = 7.0
"""From this root mean square speed on these two can be told apart, if need be: a jam often lets
the shaft go no faster. That is taken once a whole such period gave no better window."""


@dataclass
class Inquiry:
    """Features of one episode.

    Parameters
    ----------
    since_ns : windows begin no earlier
    most_windows : after so many windows what is left is left
    """

    since_ns: int
    window_ns: int
    most_windows: int
    request: FeatureRequest | None = None
    wanted: str | None = None
    computed: tuple[str, ...] = ()
    _tried: tuple[str, ...] = ()
    _answered: bool = False
    _windows: int = 1
    _until_ns: int = 0
    _end_ns: int | None = None
    _rubs: bool = False

    def plan(self, group: Mapping[str, float], chooser: FeatureChooser) -> None:
        """Choose what to ask for next, of this window or of a fresh one; `wanted` holds it."""
        self._rubs = RUBBING.issuperset(group)
        self.wanted = chooser.next(group, self._tried) if len(group) > 1 else None
        if self.wanted or not self._answered or self._windows >= self.most_windows:
            return
        self.wanted = chooser.next(group)
        if self.wanted:
            self._tried, self._answered = (), False
            self._windows += 1
            self.since_ns, self._end_ns = self._until_ns, None

    def ask(self, stamp_ns: int, episode: int, step: int) -> FeatureRequest:
        """Request what is wanted, of the window in use or of the one that ends now."""
        assert self.wanted is not None
        end_ns = self._end_ns = stamp_ns if self._end_ns is None else self._end_ns
        start_ns = end_ns - self.window_ns
        self.request = FeatureRequest(stamp_ns, episode, step, self.wanted, start_ns, end_ns)
        return self.request

    def is_due(self, stamp_ns: int, pace: Pace) -> bool:
        """Whether something is wanted, and there is a window to ask about."""
        if self.wanted is None or self._end_ns is not None:
            return self.wanted is not None
        waited_ns = stamp_ns - self.window_ns - self.since_ns
        if self._rubs and waited_ns >= 2 * REVERSAL_NS:
            return pace.reaches(CREEPING_RAD_S)
        turns = waited_ns >= REVERSAL_NS or pace.reverses
        return waited_ns >= 0 and turns and pace.reaches(MOVING_RAD_S)

    def is_open(self, stamp_ns: int, patience_ns: int) -> bool:
        """Whether an answer, or a window to ask about, is still waited for."""
        late = stamp_ns > self.since_ns + self.window_ns + patience_ns
        return self.request is not None or (self.wanted is not None and not late)

    def take(self, answer: FeatureValue) -> bool:
        """Whether an answer is that to the open request, which it then closes."""
        asked = self.request
        if asked is None or (asked.episode, asked.step) != (answer.episode, answer.step):
            return False
        self.give_up()
        self._answered = True
        if math.isnan(answer.value):
            self._end_ns = None  # the next feature on another window: this one may be spoilt
        elif answer.feature not in self.computed:
            self.computed += (answer.feature,)
        return True

    def pass_over(self, feature: str) -> None:
        """A feature of which the first window would tell nothing new."""
        self._tried += (feature,)

    def give_up(self) -> None:
        """Close the open request: its feature is not asked for again on this window."""
        assert self.request is not None
        self._tried += (self.request.feature,)
        self._until_ns = self.request.window_end_ns
        self.request = None


@dataclass
class Pace:
    """Speed of the shaft and load over the last window."""

    window_ns: int
    _scans: deque[tuple[int, float, float]] = field(default_factory=deque)

    def add(self, stamp_ns: int, speed_rad_s: float, load_n: float) -> None:
        """One scan; not a number what is not measured."""
        self._scans.append((stamp_ns, speed_rad_s, load_n))
        while self._scans[0][0] <= stamp_ns - self.window_ns:
            self._scans.popleft()

    def reaches(self, speed_rad_s: float) -> bool:
        """Whether the shaft turned so fast, root mean square; true where nothing says."""
        known = [speed * speed for _, speed, _ in self._scans if math.isfinite(speed)]
        return not known or math.fsum(known) / len(known) >= speed_rad_s**2

    @property
    def reverses(self) -> bool:
        """Whether motion or load reverses in it."""
        return reverses([row[1] for row in self._scans], [row[2] for row in self._scans])
