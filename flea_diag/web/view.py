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

"""All panels of the page as markup, redrawn only when their content has changed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from flea_diag.operator.evidence_view import followed
from flea_diag.operator.stand_view import compiling
from flea_diag.operator.state import OperatorState
from flea_diag.operator.words import later, tr
from flea_diag.web.answer import answer, chips
from flea_diag.web.causal_paths import causal_paths
from flea_diag.web.group_flow import group_flow
from flea_diag.web.history import before_features
from flea_diag.web.judgement import judgement
from flea_diag.web.markup import Markup, joined, tag
from flea_diag.web.panels import data_quality, dropped, episodes, features, streams
from flea_diag.web.size_chart import size_chart
from flea_diag.web.symbol_matrix import symbol_matrix
from flea_diag.web.tree_view import diagnosis_tree
from flea_diag.wire.records import NEVER_NS, AmbiguityGroup, Scan

MOST_IN_TREE = 8
"""Largest group whose tree is drawn: beyond it the tree is illegible and slow to compute."""
NO_EPISODE = later("No episode is open.")
NO_SIZE = later("No size is followed: it takes 20 s of motion in an open episode.")
NO_HYPOTHESES = later("No message on hypotheses yet, which holds the course of the episode.")
PATHS = later(
    "Highlighted: shortest path in the model from each possible cause (◆) to the residual that it "
    "explains. Solid: instantaneous, dashed: delayed, dotted: read by a residual."
)


@dataclass(frozen=True)
class Shown:
    """Input of the panels: state, arrival clock, and the verdict of the open episode.

    ``episode`` is None without one; it stays the same object while the verdict is only repeated.
    """

    state: OperatorState
    now_ns: int
    episode: AmbiguityGroup | None


@dataclass(frozen=True)
class Tools:
    """Input of the pictures besides the records: causal map and tree planner."""

    causal_map: Any
    planner: Callable[..., Any]


Draw = Callable[[Shown, Tools], Markup]


@dataclass(frozen=True)
class PagePanel:
    """One panel; it is redrawn when the value of ``rests_on`` changes."""

    name: str
    title: str
    css: str
    draw: Draw
    rests_on: Callable[[Shown], object]


def _answer(shown: Shown, _: Tools) -> Markup:
    return answer(shown.state, shown.now_ns)


def _answered(shown: Shown) -> object:
    state = shown.state
    group = state.group
    said = (_said(group), group.stale) if group is not None else ()
    silent = state.silent(AmbiguityGroup, shown.now_ns)
    waits = compiling(state) if group is None else ""
    return said, silent, state.detection, state.truth, state.features, waits


def _flow(shown: Shown, _: Tools) -> Markup:
    if shown.episode is None or shown.episode.summary:
        return _nothing(_without(shown))
    return joined(group_flow(shown.episode), dropped(shown.episode))


def _symbols(shown: Shown, _: Tools) -> Markup:
    if shown.episode is None or shown.episode.summary:
        return _nothing(_without(shown))
    residual = shown.state.residual
    return symbol_matrix(shown.episode, residual.names if residual is not None else ())


def _paths(shown: Shown, tools: Tools) -> Markup:
    return joined(causal_paths(tools.causal_map, shown.episode), tag("p", tr(PATHS), class_="note"))


def _tree(shown: Shown, tools: Tools) -> Markup:
    group = shown.episode
    listed = features(shown.state)
    if group is None or group.summary:
        return joined(_nothing(_without(shown)), listed)
    if not group.features_available:
        return listed
    count = len(before_features(group))
    if count > MOST_IN_TREE:
        words = tr(
            "{count} faults are possible; the tree is drawn for at most {most}.",
            count=count, most=MOST_IN_TREE,
        )  # fmt: skip
        return joined(_nothing(words), listed)
    return joined(diagnosis_tree(tools.planner, group), listed)


def _growth(shown: Shown, _: Tools) -> Markup:
    trend = followed(shown.state)
    return _nothing(tr(NO_SIZE)) if trend is None else size_chart(trend)


def _followed(shown: Shown) -> object:
    trend = followed(shown.state)
    return () if trend is None else (trend.stamp_ns, trend.episode)


def _without(shown: Shown) -> str:
    """Why a panel of the course of an episode is empty."""
    return tr(NO_EPISODE) if shown.episode is None else tr(NO_HYPOTHESES)


def _nothing(words: str) -> Markup:
    return tag("p", words, class_="soft")


def _episodes(shown: Shown, _: Tools) -> Markup:
    return episodes(shown.state)


def _quality(shown: Shown, _: Tools) -> Markup:
    return data_quality(shown.state, shown.now_ns)


def _judgement(shown: Shown, _: Tools) -> Markup:
    return judgement(shown.state, shown.now_ns)


def _streams(shown: Shown, _: Tools) -> Markup:
    return streams(shown.state, shown.now_ns)


def _second(shown: Shown) -> object:
    return shown.now_ns // 1_000_000_000


def _quality_now(shown: Shown) -> object:
    silent = shown.state.silent(Scan, shown.now_ns)
    return shown.state.quality, _second(shown) if silent else 0


def _judged(shown: Shown) -> object:
    state, group = shown.state, shown.state.group
    rows = state.quality.judged if state.quality is not None else ()
    return rows, state.silent(Scan, shown.now_ns), _said(group) if group is not None else ()


def _episode(shown: Shown) -> object:
    return _said(shown.episode) if shown.episode is not None else ()


def _episode_and_names(shown: Shown) -> object:
    residual = shown.state.residual
    return _episode(shown), residual.names if residual is not None else ()


def _episode_and_features(shown: Shown) -> object:
    state = shown.state
    return _episode(shown), state.features, state.channels, state.level is not None


def _said_by_people(shown: Shown) -> object:
    state = shown.state
    return state.alarms, state.marks, state.service, state.open_key, state.waiting


PANELS = (
    PagePanel("answer", "", "", _answer, _answered),
    PagePanel(
        "group", later("Ambiguity group, step by step"), "two-thirds scroll", _flow, _episode
    ),
    PagePanel("growth", later("Size over time"), "scroll", _growth, _followed),
    PagePanel("symbols", later("Symbols over time"), "third scroll", _symbols, _episode_and_names),
    PagePanel("causes", later("Temporal causal graph"), "scroll", _paths, _episode),
    PagePanel("tree", later("Diagnosis tree and features"), "", _tree, _episode_and_features),
    PagePanel("episodes", later("Episodes"), "scroll", _episodes, _said_by_people),
    PagePanel("quality", later("Data quality"), "half scroll", _quality, _quality_now),
    PagePanel("streams", later("Streams and nodes"), "half scroll", _streams, _second),
    PagePanel("judged", later("What was judged"), "scroll", _judgement, _judged),
)


class View:
    """Markup of the panels; ``drawn`` holds the latest of each."""

    def __init__(self, tools: Tools) -> None:
        self._tools = tools
        self._rested_on: dict[str, object] = {}
        self._episode: AmbiguityGroup | None = None
        self.drawn: dict[str, str] = {}

    def update(self, state: OperatorState, now_ns: int) -> None:
        """Redraw the panels that have changed."""
        shown = Shown(state, now_ns, self._open_episode(state.group))
        self.drawn["chips"] = str(chips(state, now_ns))
        for panel in PANELS:
            rests_on = panel.rests_on(shown)
            if panel.name not in self.drawn or self._rested_on[panel.name] != rests_on:
                self.drawn[panel.name] = str(panel.draw(shown, self._tools))
            self._rested_on[panel.name] = rests_on

    def _open_episode(self, group: AmbiguityGroup | None) -> AmbiguityGroup | None:
        """The verdict of the open episode, the same object while it is only repeated."""
        if group is None or group.detected_stamp_ns == NEVER_NS:
            self._episode = None
        elif self._episode is None or _said(group) != _said(self._episode):
            self._episode = group
        return self._episode


def _said(group: AmbiguityGroup) -> tuple[object, ...]:
    """Content that makes two verdicts different; NaN prevents comparing whole records."""
    return group.verdict, group.outcome, group.summary
