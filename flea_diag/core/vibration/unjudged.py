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

"""Accelerometers whose vibration no nominal range can judge: another rate, or nothing learned.

Without this a fault that shows in vibration alone would look like none.
"""

from __future__ import annotations

from collections.abc import Mapping

from flea_diag.core.vibration.nominal_range import NominalRanges


def unjudged(nominal: NominalRanges, rates_hz: Mapping[str, float]) -> dict[str, str]:
    """Axes without a judgement, each with the reason; ``rates_hz``: sampling rate of each axis."""
    found: dict[str, str] = {}
    for axis, rate_hz in rates_hz.items():
        if axis not in nominal.levels and axis not in nominal.kurtosis:
            found[axis] = "no nominal range was learned"
        elif not nominal.holds_at(rate_hz):
            learned = f"nominal ranges were learned at {nominal.rate_hz:.6g} Hz"
            found[axis] = f"sampled at {rate_hz:.6g} Hz, {learned}"
    return found


def said(found: Mapping[str, str]) -> str:
    """What is not judged and why, axes of one accelerometer together; empty: nothing."""
    sensors: dict[str, dict[str, None]] = {}
    for axis, reason in found.items():
        sensors.setdefault(reason, {})[axis.rsplit("_", 1)[0]] = None
    parts = [f"{', '.join(names)}: {reason}" for reason, names in sensors.items()]
    return "; ".join(parts) + ": not judged; 'flea features learn' makes ranges" if parts else ""
