"""What an episode asks of vibration: which feature next, on which window, and how long.

What a fault does to a feature was learned on windows in motion with the fault there throughout.
So a window begins after the detection and holds motion. When all features of one window are
used up and several faults are left, they are asked for anew on the next window.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field

from flea_diag.core.feature_choice import FeatureChooser
from flea_diag.core.nominal_range import MOVING_RAD_S
from flea_diag.wire.records import FeatureRequest, FeatureValue


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

    def plan(self, group: Mapping[str, float], chooser: FeatureChooser) -> None:
        """Choose what to ask for next, of this window or of a fresh one; `wanted` holds it."""
        self.wanted = chooser.next(group, self._tried) if len(group) > 1 else None
        if self.wanted or not self._answered or self._windows >= self.most_windows:
            return
        self.wanted = chooser.next(group)
        if self.wanted:
            self._tried, self._answered = (), False
            self._windows += 1
            self.since_ns = self._until_ns

    def ask(self, stamp_ns: int, episode: int, step: int) -> FeatureRequest:
        """Request what is wanted, of the window that ends now."""
        assert self.wanted is not None
        start_ns = stamp_ns - self.window_ns
        self.request = FeatureRequest(stamp_ns, episode, step, self.wanted, start_ns, stamp_ns)
        return self.request

    def is_fresh(self, stamp_ns: int) -> bool:
        """Whether the window that ends now may be asked about."""
        return stamp_ns - self.window_ns >= self.since_ns

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
        if not math.isnan(answer.value) and answer.feature not in self.computed:
            self.computed += (answer.feature,)
        return True

    def give_up(self) -> None:
        """Close the open request: its feature is not asked for again on this window."""
        assert self.request is not None
        self._tried += (self.request.feature,)
        self._until_ns = self.request.window_end_ns
        self.request = None


@dataclass
class Pace:
    """Speeds of the shaft over the last window."""

    window_ns: int
    _speeds: deque[tuple[int, float]] = field(default_factory=deque)

    def add(self, stamp_ns: int, speed_rad_s: float) -> None:
        """Speed of one scan; not a number where it is not measured."""
        self._speeds.append((stamp_ns, speed_rad_s))
        while self._speeds[0][0] <= stamp_ns - self.window_ns:
            self._speeds.popleft()

    @property
    def is_moving(self) -> bool:
        """Whether the shaft turned as in the windows learned from; true where nothing says."""
        known = [speed * speed for _, speed in self._speeds if math.isfinite(speed)]
        return not known or math.fsum(known) / len(known) >= MOVING_RAD_S**2
