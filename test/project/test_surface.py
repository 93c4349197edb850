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

"""Nothing that users hold on to by name is lost, and whatever is new is in the list."""

from __future__ import annotations

import pytest
from support.programs.surface import KEPT, surface


@pytest.mark.slow  # imports every command and every node
def test_the_list_of_all_that_users_name_is_kept() -> None:
    kept, now = set(KEPT.read_text(encoding="utf-8").splitlines()), set(surface())
    lost, added = sorted(kept - now), sorted(now - kept)
    assert not lost, f"gone, and CHANGELOG.md must say what to use instead: {lost}"
    assert not added, f"new: renew the list with `python test/support/programs/surface.py`: {added}"
