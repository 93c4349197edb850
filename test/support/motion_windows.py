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

"""Motions of the shaft as the isolator sees them: speed and load of the last seconds."""

from __future__ import annotations

from flea_diag.stages.isolator.motion_window import MotionWindow

S = 1_000_000_000


def motion(*scans: tuple[float, float]) -> MotionWindow:
    """Speed and load over the last second."""
    made = MotionWindow(S)
    for number, scan in enumerate(scans):
        made.add(number * S // len(scans), *scan)
    return made


def moved(*speeds: float) -> MotionWindow:
    """100 scans a second at each of these speeds in turn, from 10 s on."""
    made = MotionWindow(S)
    for number in range(100 * len(speeds)):
        made.add(10 * S + number * S // 100, speeds[number // 100], 40.0)
    return made
