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

"""The evidence on an actuator of few sensors: its calibration, and runs that it has not seen."""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from flea_diag.configuration.evidence import EvidenceStand, with_law
from flea_diag.configuration.stand import load_stand
from flea_diag.core.calibration.calibration import Calibration, NominalRun
from flea_diag.tools.calibrate.nominal_recording import NominalRecording
from flea_diag.tools.calibrate.procedure import learn
from flea_diag.wire.blocks import ScanBlock
from flea_diag.wire.records import ChannelInfo, ChannelTable
from support.models import linear_ema as ema
from support.places import FLEA_STAND
from support.stands import shared_calibration

STAND = load_stand(str(FLEA_STAND))
PERIOD_NS = 10_000_000
ONSET_S = 9.0


@cache
def calibration() -> Calibration:
    """Of ten healthy runs of 12 s, with their law."""
    return shared_calibration("linear_ema with a law", _learned)


def _learned() -> Calibration:
    runs = []
    for n, columns in enumerate(ema.nominal_runs()[:5]):
        for half in (slice(0, 1200), slice(1200, 2400)):
            part = {name: values[half] for name, values in columns.items()}
            run = NominalRun(f"run{n}_{half.start}", ema.rows(part, ema.STAND))
            runs.append(NominalRecording(run, "s", ema.STAND, "mean", 0.01))
    return learn(runs, STAND.actuator, 0.1, faults=STAND.faults).calibration


@cache
def diagnosis() -> EvidenceStand:
    """The evidence by that law."""
    law = calibration().law
    assert law is not None
    return with_law(STAND, calibration(), law)


@cache
def running(**faulty: float) -> ema.Columns:
    """A run of 24 s that none of the others is; from ``ONSET_S`` on it may be another actuator."""
    changed = ema.changed(**faulty) if faulty else None
    motion, mean = ema.MOTIONS[5]
    columns = ema.run(
        ema.HEALTHY, 24.0, motion, lambda t: mean + 40.0 * math.sin(1.3 * t), changed, ONSET_S
    )
    return ema.noisy(columns, 90)


def table(extra: tuple[str, ...] = ()) -> ChannelTable:
    """The channels of the stand, with wide ranges."""
    names = (*calibration().channels, *extra)
    return ChannelTable(1, "flea", tuple(ChannelInfo(n, "", -1e9, 1e9, 100.0) for n in names))


def block(columns: ema.Columns, first: int = 0) -> ScanBlock:
    """A run as scans, the first of them at a stamp of its number."""
    rows = np.column_stack([columns[name] for name in calibration().channels])
    stamps = PERIOD_NS * (1 + first + np.arange(len(rows)))
    return ScanBlock(stamps, calibration().channels, rows)
