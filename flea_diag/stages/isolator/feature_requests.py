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

"""Requests vibration features one at a time, and holds later records until the answer."""

from __future__ import annotations

from flea_diag.core.choice.feature_choice import FeatureChooser
from flea_diag.stages.isolator.fault_episode import FaultEpisode
from flea_diag.stages.isolator.motion_window import MotionWindow
from flea_diag.stages.isolator.parameters import IsolatorParameters, Knowledge
from flea_diag.stages.merge import Merge
from flea_diag.wire.records import FeatureRequest, FeatureValue


class FeatureRequests:
    """Requests the next best feature and applies its answer to the hypotheses.

    Parameters
    ----------
    merge : held at the stamp at which the answer is due
    """

    def __init__(self, knowledge: Knowledge, parameters: IsolatorParameters, merge: Merge) -> None:
        self._table = knowledge.features
        self._chooser = FeatureChooser(knowledge.features, parameters.strategy)
        self._answer_after_ns = round(parameters.answer_budget_s * 1e9)
        self._limit_ns = parameters.answer_limit_s * 1e9
        self._merge = merge

    def ask(
        self, stamp_ns: int, episode: FaultEpisode, window: MotionWindow
    ) -> tuple[FeatureRequest, ...]:
        """Request the next best feature, if one can split the remaining group."""
        query = episode.query
        if not episode.settled or query.request is not None:
            return ()
        query.plan(episode.group(), self._chooser)
        if not query.is_due(stamp_ns, window):
            return ()
        episode.step += 1
        self._merge.hold(stamp_ns + self._answer_after_ns)
        return (query.ask(stamp_ns, episode.shared.number, episode.step),)

    def take(self, answer: FeatureValue, episode: FaultEpisode) -> bool:
        """Apply an answer; False if it does not belong to the open request."""
        if not episode.query.take(answer):
            return False
        self._merge.hold(None)
        if answer.symbol != "?":
            left = episode.query.odds.after(
                episode.group(), self._table, answer.feature, answer.symbol
            )
            episode.isolation.update(answer.stamp_ns, answer.feature, answer.symbol, left)
        return True

    def give_up(self, stamp_ns: int, episode: FaultEpisode) -> None:
        """Treat a feature without an answer as not computable."""
        request = episode.query.request
        if request is not None and stamp_ns - request.stamp_ns > self._limit_ns:
            episode.query.give_up()
            self._merge.hold(None)
