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

"""The records of a recipe, as a stand would have sent them, with their truth."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from flea_diag.errors import RecordingError
from flea_diag.tools.campaign.case import Recipe
from flea_diag.tools.campaign.run_result import NOMINAL
from flea_diag.tools.motion import POSITION
from flea_diag.wire.records import ChannelTable, Record, Scan, Truth, VibrationBlock

SENT = (ChannelTable, Truth, VibrationBlock, Scan)
"""Records of a stand and its truth; a diagnosis that a bag holds is left out."""


def records_of(recipe: Recipe) -> Iterator[Record]:
    """Records of a run in the order in which the stages receive them.

    Raises
    ------
    FleaError
        A recording or scenario cannot be used.
    """
    if recipe.scenario:
        return _simulated(recipe)
    if recipe.faulty:
        return iter(_spliced(recipe))
    if recipe.fault:
        return iter(_injected(recipe))
    return _read(recipe.recording)


def _simulated(recipe: Recipe) -> Iterator[Record]:
    """The simulated stand; each record is encoded and decoded as on the wire."""
    from flea_diag.wire.messages.codec import decode, encode
    from flea_sim_driver.scenario.scenario_file import scenario_from_mapping
    from flea_sim_driver.stand import SimulatedStand

    for record in SimulatedStand(scenario_from_mapping(recipe.scenario, "scenario")):
        sent: Record = decode(type(record), encode(record, "stand"))
        yield sent


def _read(bag: str) -> Iterator[Record]:
    from flea_diag.wire.bags.bag import BagReader

    return (record for _, record in BagReader(Path(bag)).records(SENT))


def _spliced(recipe: Recipe) -> tuple[Record, ...]:
    from flea_diag.tools.recordings.splice import splice

    return splice(list(_read(recipe.recording)), list(_read(recipe.faulty)), recipe.margin_s)


def _injected(recipe: Recipe) -> Iterable[Record]:
    """A recorded run with a software fault in one channel from a time in motion on."""
    from flea_diag.tools.recordings import injection

    records = list(_read(recipe.recording))
    scans = [record for record in records if isinstance(record, Scan)]
    table = next((record for record in records if isinstance(record, ChannelTable)), None)
    if not scans or table is None:
        raise RecordingError(f"{recipe.recording}: no scans or no channel table in it")
    times = np.array([(scan.stamp_ns - scans[0].stamp_ns) / 1e9 for scan in scans])
    position = np.array([scan.value(POSITION) for scan in scans])
    row = injection.row_of(*recipe.fault.split())
    possible = injection.onsets(times, position)
    made = injection.draw(row, possible, recipe.seed, recipe.number, recipe.size)
    return injection.injected(table, scans, made)


def first_fault(records: Iterable[Record]) -> Truth | None:
    """The truth of the fault that begins first; None: there is none."""
    truths = (record for record in records if isinstance(record, Truth))
    wrong = [truth for truth in truths if truth.fault not in ("", NOMINAL)]
    return min(wrong, key=lambda truth: truth.onset_ns, default=None)
