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

"""An operator accepts a unit as healthy that differs by more than the calibration allows.

The decision is a remark: it goes into the journal and the bag, to every screen and to the isolator,
names who made it and why, and can be taken back. It holds for the unit that the observer has told
from the calibrated ones; one that starts later is judged anew.
"""

from __future__ import annotations

from flea_diag.operator.state import OperatorState
from flea_diag.operator.words import later
from flea_diag.wire.records import OTHER_UNIT, ChannelQuality, Quality, Remark, RemarkKind

TAKE_BACK = "reject"
ASKED = later("Accept this unit as healthy, for what reason?")
EXAMPLE = later("rewound, resistance measured; 'reject' takes it back")


def unit_in_question(state: OperatorState) -> ChannelQuality | None:
    """The row of data quality of a unit beyond what healthy ones differ by."""
    rows = state.quality.channels if state.quality is not None else ()
    other = (row for row in rows if row.channel == OTHER_UNIT)
    return next((row for row in other if row.quality is Quality.SATURATED), None)


def decision(unit: ChannelQuality, text: str, stamp_ns: int, author: str) -> Remark:
    """Accept this unit for the reason that was given, or take that back."""
    back = text.strip() == TAKE_BACK
    kind = RemarkKind.UNIT_REJECTED if back else RemarkKind.UNIT_ACCEPTED
    reason = "" if back else text.strip()
    return Remark(stamp_ns, kind, author, reason, "", unit.since_ns)
