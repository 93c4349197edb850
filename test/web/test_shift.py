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

"""Ten minutes of a shift: the page is restarted under an alarm, and all accounts of it agree.

The whole one, two hours with twelve faults, is bench/robustness/shift.py.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from support import browser as browsers

pytest.importorskip("nicegui", reason="the page needs NiceGUI: pip install nicegui")

from support.screens.shift import shift_of

RESTART_PAGE = 1


@pytest.mark.in_turn(3)
def test_journal_page_report_and_recording_agree_to_the_second(tmp_path: Path) -> None:
    if browsers.missing():
        pytest.skip(browsers.missing())
    with shift_of(tmp_path, 1, RESTART_PAGE) as shift:
        found = shift.run()
    assert (found.missed, found.false_alarms, found.differences) == ([], [], [])
    assert found.alarms >= 1
    assert len(found.named) == 1
