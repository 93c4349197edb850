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

"""The whole screen as a function of the state: ``view(state, now_ns)``, top to bottom.

Order: verdict, recommended action, evidence, status of the stand.
"""

from __future__ import annotations

from flea_diag.operator import (
    action_view,
    advice_view,
    alarm_view,
    evidence_view,
    judgement_view,
    stand_view,
    verdict_view,
)
from flea_diag.operator.panel import Panel
from flea_diag.operator.state import OperatorState


def view(state: OperatorState, now_ns: int) -> tuple[Panel, ...]:
    """Non-empty panels; ``now_ns`` is the arrival clock."""
    panels = (
        verdict_view.verdict(state, now_ns),
        action_view.to_do(state),
        verdict_view.possible(state),
        evidence_view.growth(state),
        advice_view.next_tests(state),
        verdict_view.steps(state),
        verdict_view.dropped(state),
        verdict_view.unseen(state),
        evidence_view.symbols(state),
        evidence_view.features(state),
        evidence_view.residuals(state),
        stand_view.streams(state, now_ns),
        stand_view.channels(state, now_ns),
        judgement_view.judged(state, now_ns),
        stand_view.nodes(state),
        alarm_view.marks(state),
        alarm_view.alarms(state),
    )
    return tuple(panel for panel in panels if panel is not None)


def page(panels: tuple[Panel, ...]) -> str:
    """The screen in plain text."""
    return "\n\n".join(panel.text().replace("\n", "\n  ") for panel in panels) + "\n"
