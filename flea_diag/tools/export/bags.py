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

"""A whole diagnosis as a bag: what the nodes would have published, beside what the stand sent."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from flea_diag.api.recording import SENT, Recording
from flea_diag.configuration.component import make_pipeline
from flea_diag.configuration.stand import Stand
from flea_diag.tools.replay.replay import diagnosed
from flea_diag.wire.bags.bag_writer import new_bag
from flea_diag.wire.blocks import Block
from flea_diag.wire.records import AmbiguityGroup, Record, VibrationBlock


def save_diagnosis(recording: Recording, stand: Any, target: Path) -> int:
    """Write a recording with the records of its diagnosis to a new bag; number of records.

    Each verdict is followed by its hypotheses, as the nodes publish both. Vibration is left out.

    Raises
    ------
    RecordingError
        The folder exists or cannot be written.
    FleaError
        The stand or its calibration is refused.
    """
    assert isinstance(stand, Stand)
    with new_bag(target, stand.name) as bag:
        said = diagnosed(recording.records(SENT), make_pipeline(stand))
        return bag.write_all(each for record in said for each in _published(record))


def _published(record: Record | Block) -> tuple[Record | Block, ...]:
    if isinstance(record, VibrationBlock):
        return ()
    return (record, record.hypotheses()) if isinstance(record, AmbiguityGroup) else (record,)
