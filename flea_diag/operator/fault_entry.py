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

"""Interface through which operators inject faults into a simulated stand."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol


class FaultEntry(Protocol):
    """Accepts faults while ``present``."""

    present: bool

    def set(self, value: str, told: Callable[[str], None]) -> None:
        """Inject a fault ('' clears all); ``told`` is called with the reason of a refusal or ''."""


class NoFaults:
    """A stand that accepts no faults."""

    present = False

    def set(self, value: str, told: Callable[[str], None]) -> None:
        """Refuse."""
        told("no simulated stand is running")
