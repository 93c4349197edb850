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

"""What several tests share; no test imports another test."""

from __future__ import annotations

import os

ALL = "ALL_EXAMPLES"
SHARE = 4
"""Of so many examples one is tried, unless all are asked for."""


def examples(most: int) -> int:
    """A quarter of ``most``; all of them where the variable ``ALL_EXAMPLES`` is set."""
    return most if os.environ.get(ALL) else max(most // SHARE, 1)
