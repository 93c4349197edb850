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

"""A clock that stands still: whatever is told as a rate or a cost is told, without a traceback."""

from __future__ import annotations

import time
from pathlib import Path
from unittest.mock import patch

import pytest

from flea_diag.tools.main import main

READ = ("time", "monotonic", "perf_counter", "process_time")


@pytest.mark.parametrize(
    "command", ["simulate nominal --duration 1 --no-vibration -o {}/run", "features bench"]
)
def test_no_clock_moves(command: str, tmp_path: Path) -> None:
    seconds = dict.fromkeys(READ, lambda: 5.0)
    whole = {f"{name}_ns": lambda: 5_000_000_000 for name in READ}
    with patch.multiple(time, **seconds, **whole):
        assert main(command.format(tmp_path).split()) == 0
