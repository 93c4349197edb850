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

"""The number of runs of a campaign, from its numbers alone, before they are listed."""

from __future__ import annotations

from flea_diag.tools.campaign.campaign import (
    HALVES,
    Campaign,
    Drawn,
    Injections,
    Recordings,
    Scenarios,
    Source,
)
from flea_diag.tools.campaign.recording_set import FOLDS, RecordingSet
from flea_diag.tools.campaign.run_result import NOMINAL


def run_count(campaign: Campaign, recordings: RecordingSet) -> int:
    """Runs of all sources with all configurations; at most so many where recordings are joined."""
    once = sum(_runs(source, campaign, recordings) for source in campaign.sources)
    return once * len(campaign.configurations)


def _runs(source: Source, campaign: Campaign, recordings: RecordingSet) -> int:
    if isinstance(source, Drawn):
        return source.times * sum(row.cases for row in source.rows)
    if isinstance(source, Scenarios):
        return source.times * len(source.files)
    if isinstance(source, Injections):
        return source.cases * _rungs(source)
    if isinstance(source, Recordings):
        # Each half of the nominal recordings scores the other half, both score the faulty ones.
        folds = len(FOLDS) if campaign.calibration == HALVES else 1
        runs = recordings.matching(source.files, campaign.folder)
        return sum(1 if run.truth == NOMINAL else folds for run in runs)
    return len(recordings.matching(source.faulty, campaign.folder))


def _rungs(source: Injections) -> int:
    """Rows, or sizes of their ladders; an unknown row counts once, and is refused by the plan."""
    from flea_diag.tools.recordings import injection

    ladders = {f"{row.channel} {row.mode}": row.ladder for row in injection.ROWS}
    rungs = {title: len(ladder) if source.ladder else 1 for title, ladder in ladders.items()}
    return sum(rungs.get(title, 1) for title in source.rows or ladders)
