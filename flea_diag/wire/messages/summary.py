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

"""Summary of a verdict: every member by name, reasons as far as the size allows, and counts.

A verdict is repeated once a second and read on terminals, so its message stays small; what it
rests on is published once, as ``Hypotheses``.
"""

from __future__ import annotations

from dataclasses import replace

from flea_diag.wire.messages.codec import encode
from flea_diag.wire.messages.judgement import NAMES
from flea_diag.wire.records import AmbiguityGroup, Candidate

MOST_BYTES = 4000
"""Size of the message up to which members get a status of their own. Names are never left out:
of a group whose names alone are longer, the message is as large as they need."""
MOST_LETTERS = 240
"""Longest list of names within the words of a verdict; a longer one is given as a number."""


def summary(group: AmbiguityGroup, stand: str = "stand") -> AmbiguityGroup:
    """The verdict with as many reasons as fit; ``stand`` is the name that is encoded with it."""
    brief = replace(
        group,
        members=tuple(Candidate(member.fault) for member in group.members),
        dropped=(),
        words=_words(group),
        not_observable=(),
        shows_from=(),
        looked_for=(),
        next_tests=(),
        summary=True,
        dropped_count=len(group.dropped),
        not_observable_count=len(group.not_observable),
    )
    for count, member in enumerate(group.members, 1):
        first = (*brief.members[: count - 1], replace(member, evidence=()))
        longer = replace(brief, members=(*first, *brief.members[count:]))
        if len(encode(longer, stand)) > MOST_BYTES:
            break
        brief = longer
    return brief


def _words(group: AmbiguityGroup) -> str:
    """The words of a verdict; a long list of names in it becomes their number."""
    names = NAMES.join(member.fault for member in group.members)
    if len(names) <= MOST_LETTERS:
        return group.words
    number = f"{len(group.members)} faults"
    return group.words.replace(f": {names}", f" {number}").replace(names, number)
