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

"""Scans of late, of which windows are formed when somebody asks for them."""

from __future__ import annotations

from flea_diag.core.evidence.stream_windows import LawScans, LawWindow, LawWindowMeans
from flea_diag.core.state_copy import state_copy


class KeptScans:
    """Keeps at least the scans of the last ``most`` windows.

    What windows have of those before them is in ``means``, which has taken what is kept no more.
    """

    def __init__(self, means: LawWindowMeans, scans: int, most: int) -> None:
        self._means, self._scans, self._most = means, scans, most
        self._kept: list[LawScans] = []
        self._count = 0

    def add(self, scans: LawScans) -> None:
        """Take n scans."""
        self._kept.append(scans)
        self._count += len(scans)
        if self._count > 2 * self._most * self._scans:
            self._shorten()

    def windows(self) -> tuple[LawWindowMeans, LawWindow]:
        """The last windows that are whole, at most ``most``, and what makes those that follow."""
        self._shorten()
        means = state_copy(self._means)
        return means, means.together(self._kept[0])[1]

    def _shorten(self) -> None:
        """Forget the oldest."""
        kept = LawScans.joined(self._kept)
        past = max(self._count // self._scans - self._most, 0) * self._scans
        self._means.pass_over(kept.part(slice(past)))
        self._kept, self._count = [kept.part(slice(past, None))], self._count - past
