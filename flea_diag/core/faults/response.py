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

"""What people do about a fault: the part, how urgent it is, whether to stop, what to look at.

The catalogue states it (``response`` of a fault, of a mode of a sensor); what it leaves out follows
from the rest of the row, so that a fault without any has an answer too.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Annotated

from flea_diag.fields.values import one_of

URGENCIES = ("planned", "soon", "now")
"""The more urgent later."""
STOP, GO_ON = "stop", "go on"
RUNS = (GO_ON, STOP)
MOST_PARTS, LONGEST = 3, 240
"""Parts named of a group, and letters of each text: a verdict is repeated once a second."""

Pairs = tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Response:
    """Empty texts are those that the row of the fault gives by default."""

    name: str = ""
    part: str = ""
    where: str = ""
    urgency: Annotated[str, one_of("", *URGENCIES)] = ""
    run: Annotated[str, one_of("", *RUNS)] = ""
    next_test: str = ""
    procedure: str = ""


UNSTATED = Response()


def completed(
    given: Response, fault: str, component: str, onset: str, excitation: str, channel: str
) -> Response:
    """What the catalogue states, completed by what follows from the row of the fault.

    What sets in at once is urgent and stops the stand, what wears can wait; a sensor alone harms
    nothing.
    """
    name = fault.replace("_", " ")
    urgency = {"abrupt": "now", "incipient": "planned"}.get(onset, "soon")
    look = f"Inspect the {component}."
    if channel:
        name, urgency = f"sensor of {name}", "soon"
        look = (
            f"Compare {channel.replace('_', ' ')} with a second instrument; check plug and cable, "
            "then the sensor."
        )
    return Response(
        given.name or f"{name[0].upper()}{name[1:]}",
        given.part or component.replace("_", " "),
        given.where,
        given.urgency or urgency,
        given.run or (STOP if urgency == "now" else GO_ON),
        given.next_test or (f"Show it again: {excitation}." if excitation else ""),
        given.procedure or look,
    )


def to_do(responses: Sequence[Response]) -> Pairs:
    """What to do about a group of faults, the most probable first; as pairs of key and text.

    One that is still possible and urgent makes the group urgent, one that stops the stand stops it.
    """
    if not responses:
        return ()
    first = responses[: MOST_PARTS + 1]
    pairs = (
        ("run", STOP if any(r.run == STOP for r in responses) else GO_ON),
        ("urgency", max((r.urgency for r in responses), key=URGENCIES.index)),
        ("name", _each(r.name for r in first) if len(responses) <= MOST_PARTS else ""),
        ("part", _each(f"{r.part}, {r.where}" if r.where else r.part for r in responses)),
        ("procedure", responses[0].procedure),
        ("next_test", responses[0].next_test),
    )
    return tuple((key, text[:LONGEST]) for key, text in pairs if text)


def _each(texts: Iterable[str]) -> str:
    """Different texts, one after another, and how many more there are."""
    found = list(dict.fromkeys(texts))
    more = f" and {len(found) - MOST_PARTS} more" if len(found) > MOST_PARTS else ""
    return "; ".join(found[:MOST_PARTS]) + more
