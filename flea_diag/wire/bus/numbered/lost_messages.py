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

"""Messages lost on the way, found by the numbers that their writer gives them.

The event ``message_lost`` is not used: rmw_fastrtps takes it under two locks in the order opposite
to that of its receiving thread, and under a flood the two wait for each other for ever
(ros2/rmw_fastrtps#890).
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

NUMBER = "publication_sequence_number"
SETTLED = 10
"""Consecutive numbers after which, of several writers, one alone is taken to be left."""


class LostMessages:
    """Counts the numbers that are missing on a topic with one writer.

    Numbers do not tell writers apart: while there are several, nothing is counted.

    Parameters
    ----------
    writers
        Returns the present number of writers; asked at a gap alone.
    """

    def __init__(self, writers: Callable[[], int]) -> None:
        self._writers = writers
        self._last: int | None = None
        self._consecutive = SETTLED

    def before(self, number: int | None) -> int:
        """Messages lost before this one; ``number`` is None where the middleware gives none."""
        last, self._last = self._last, number
        if last is None or number is None:
            return 0
        if number == last + 1:
            self._consecutive += 1
            return 0
        if number <= last or self._writers() > 1:  # it began anew, or others write as well
            self._consecutive = 0
            return 0
        return number - last - 1 if self._consecutive >= SETTLED else 0


def numbered(take: Callable[[bytes, int | None], None]) -> Callable[..., None]:
    """Callback of a raw subscription that passes a message with its number to ``take``."""

    def received(*given: Any) -> None:
        # rclpy's EventsExecutor passes message and information as one tuple, the others as two.
        data, information = given[0] if len(given) == 1 else given
        take(data, information[NUMBER])

    def as_documented(message: bytes, information: dict[str, Any]) -> None: ...

    # rclpy reads the signature to decide what it passes.
    received.__signature__ = inspect.signature(as_documented)  # type: ignore[attr-defined]
    return received
