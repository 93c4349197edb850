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

"""Diagnosers of others that fail, each in a way of its own."""

from __future__ import annotations

import threading
from typing import Any


class Silent:
    """Never says anything; prints, which must not be taken for an answer."""

    def __init__(self, stand: dict[str, Any]) -> None:
        self.stand = stand
        print("hello")  # noqa: T201

    def update(self, time_s: float, row: dict[str, float]) -> Any:
        """Nothing new."""


class Raises(Silent):
    """Raises on the first row."""

    def update(self, time_s: float, row: dict[str, float]) -> Any:
        """Fail."""
        raise ValueError("no idea")


class Hangs(Silent):
    """Never answers."""

    def update(self, time_s: float, row: dict[str, float]) -> Any:
        """Wait for what never comes."""
        threading.Event().wait()


class Greedy(Silent):
    """Takes 2 GB."""

    def update(self, time_s: float, row: dict[str, float]) -> Any:
        """Take them."""
        return {"jam": float(len(bytearray(2 << 30)))}


class Dies(Silent):
    """Ends its process."""

    def update(self, time_s: float, row: dict[str, float]) -> Any:
        """End."""
        raise SystemExit(3)


class Typo(Silent):
    """Names a fault that is none."""

    def update(self, time_s: float, row: dict[str, float]) -> Any:
        """Name it."""
        return {"jamm": 1.0}


class Nan(Silent):
    """Gives a weight that is no number."""

    def update(self, time_s: float, row: dict[str, float]) -> Any:
        """Give it."""
        return {"jam": float("nan")}


class Words(Silent):
    """Gives words in place of weights."""

    def update(self, time_s: float, row: dict[str, float]) -> Any:
        """Give them."""
        return {"jam": "likely"}


class Course(Silent):
    """Goes through all that may be answered, one answer a row."""

    SAID = (None, {"jam": 3.0, "spall": 1.0}, {"jam": 3.0, "spall": 1.0}, {"jam": 1.0}, {},
            {"unknown": 1.0}, {})  # fmt: skip

    def update(self, time_s: float, row: dict[str, float]) -> Any:
        """The answer for this row."""
        return self.SAID[min(round(time_s * 100), len(self.SAID) - 1)]
