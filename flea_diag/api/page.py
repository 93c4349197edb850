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

"""A diagnosis as a piece of a notebook's page."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from html import escape
from typing import Any

from flea_diag.errors import visible

MOST_NAMED = 12
HEADS = ("fault", "probability", "size", "latest evidence")


def page(
    name: str, outcome: str, words: str, episodes: Sequence[Any], unobservable: Iterable[str]
) -> str:
    """Outcome, episodes with their groups, and what could not be seen."""
    head = f"<p><b>{_text(name)}: {_text(outcome or 'no verdict')}</b></p>"
    said = f"<p>{_text(words)}</p>" if not episodes else ""
    unseen = list(unobservable)
    rest = f" and {len(unseen) - MOST_NAMED} more" if len(unseen) > MOST_NAMED else ""
    names = f"<p>not observable: {_text(', '.join(unseen[:MOST_NAMED]))}{rest}</p>"
    return head + said + "".join(map(_episode, episodes)) + (names if unseen else "")


def _episode(episode: Any) -> str:
    times = f"detected at {episode.detected_at_s:.2f} s, verdict since {episode.settled_at_s:.2f} s"
    heads = "".join(f"<th>{head}</th>" for head in HEADS)
    rows = "".join(map(_row, episode.group))
    table = f"<table><tr>{heads}</tr>{rows}</table>" if rows else ""
    return f"<p>{_text(episode.outcome)}: {_text(episode.words)} ({times})</p>{table}"


def _row(row: Any) -> str:
    known = math.isfinite(row.size)
    size = f"{row.size:.3g} ± {row.size_sigma:.2g} {row.size_unit}" if known else ""
    chance = f"{row.probability:.3f}" if math.isfinite(row.probability) else ""
    cells = (row.fault, chance, size, row.reason)
    return "<tr>" + "".join(f"<td>{_text(cell)}</td>" for cell in cells) + "</tr>"


def _text(words: str) -> str:
    return escape(visible(words))
