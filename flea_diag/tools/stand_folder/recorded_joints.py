"""Joints of a robot in a recording, of which a stand is one."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass

from flea_diag.errors import RecordingError, shown
from flea_diag.tools.stand_folder.recorded_series import RecordedSeries, Series

_WORDS = re.compile(r"[a-z]+\d*|\d+")
_ANY = frozenset({"joint", "axis", "state", "states", "motor"})
"""Words of topics and joints that tell none from another."""


@dataclass(frozen=True)
class RecordedJoints:
    """Joints that move, and the one that is looked at; "" where there are none."""

    names: tuple[str, ...]
    chosen: str

    @classmethod
    def of(cls, recorded: RecordedSeries, wanted: str = "") -> RecordedJoints:
        """Joints of a recording, and of them the one wanted, or that of which most is recorded.

        Elements of a JointState with one field each are channels rather than joints.

        Raises
        ------
        RecordingError
            The one wanted does not move.
        """
        fields = Counter(
            element for each in recorded.series if (element := element_of(each)) and each.changes
        )
        names = tuple(fields) if max(fields.values(), default=0) > 1 else ()
        if wanted and wanted not in names:
            raise RecordingError(
                f"{recorded.path}: no joint {shown(wanted)} moves; joints that move are "
                f"{', '.join(names) or 'none'}"
            )
        topics = {word for each in recorded.series for word in _of_topic(each)}
        told = {name: (fields[name], bool(_words(name) & topics)) for name in names}
        return cls(names, wanted or max(told, key=lambda name: told[name], default=""))

    def is_of_another(self, series: Series) -> bool:
        """Whether a series is of another joint, by its element or by its topic."""
        if not self.chosen:
            return False
        element = element_of(series)
        if element:
            return element != self.chosen
        words, own = _of_topic(series), _words(self.chosen)
        others = [name for name in self.names if name != self.chosen]
        return not own & words and any(_words(name) & words - own for name in others)


def element_of(series: Series) -> str:
    """Element of a JointState that a field is of; "" for other fields."""
    field = series.place.get("field", "")
    is_state = series.place.get("type", "").endswith("/JointState")
    return field.partition("[")[2].rstrip("]") if is_state else ""


def _of_topic(series: Series) -> frozenset[str]:
    return frozenset() if element_of(series) else _words(series.place.get("topic", ""))


def _words(text: str) -> frozenset[str]:
    return frozenset(_WORDS.findall(text.lower())) - _ANY
