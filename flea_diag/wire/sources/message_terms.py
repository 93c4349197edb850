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

"""What the messages of mapped topics hold for the channels of a stand."""

from __future__ import annotations

from typing import Any

from flea_diag.wire.records import SECOND_NS
from flea_diag.wire.sources.mapping import SourceMapping, SourceTerm


class MessageTerms:
    """Reads the terms of a mapping off messages.

    Attributes
    ----------
    found
        Numbers of the terms that a message had.
    """

    def __init__(self, mapping: SourceMapping) -> None:
        self.found: set[int] = set()
        self._terms: dict[str, list[tuple[int, SourceTerm]]] = {}
        for number, term in enumerate(mapping.terms):
            self._terms.setdefault(term.topic, []).append((number, term))

    def read(self, topic: str, message: Any) -> list[tuple[int, float]]:
        """Number and value of each term in a message of a topic.

        Raises
        ------
        WireError
            A field is missing or no number.
        """
        values = []
        for number, term in self._terms[topic]:
            value = None if term.path is None else term.path.read(message)
            if value is not None:
                values.append((number, value))
                self.found.add(number)
        return values


def stamp_of(message: Any, received_ns: int) -> int:
    """Stamp of the header, or of the message; without one, or with 0, the time of receipt."""
    stamp = getattr(getattr(message, "header", message), "stamp", None)
    seconds, rest = getattr(stamp, "sec", None), getattr(stamp, "nanosec", None)
    if seconds is None or rest is None:
        return received_ns
    return int(seconds) * SECOND_NS + int(rest) or received_ns
