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

"""Serial dates of MATLAB, days since the year 0: the same moments as by the calendar of Python."""

from __future__ import annotations

from datetime import datetime, timezone
from pathlib import Path

import numpy as np
from scipy.io import savemat
from support.foreign.recordings_of_others import PERIOD_NS, SCANS, Sent

from flea_diag.tools.main import main
from flea_diag.wire.bags.bag import read_bag
from flea_diag.wire.records import Scan

MOMENT = datetime(2021, 3, 4, 5, 6, 7, tzinfo=timezone.utc)
SENT = (
    Sent("actuator_position", "position", "mm"),
    Sent("motor_current", "current"),
    Sent("load_force", "force"),
)


def datenum(moment: datetime) -> float:
    """As MATLAB counts: 1 January of the year 0 is day 1."""
    midnight = moment.replace(hour=0, minute=0, second=0)
    return moment.toordinal() + 366 + (moment - midnight).total_seconds() / 86400.0


def test_a_table_of_datenums_is_read_at_its_own_moments(tmp_path: Path) -> None:
    days = datenum(MOMENT) + np.arange(SCANS) * 1e-9 * PERIOD_NS / 86400.0
    table = tmp_path / "run.mat"
    savemat(table, {"datenum": days, **{each.name: each.readings() for each in SENT}})
    stand, bags = tmp_path / "mine", tmp_path / "bags"
    assert main(["stand", "new", str(stand), "--from", str(table)]) in (0, 1)
    assert "unit: datenum" in (stand / "channels.yaml").read_text()
    assert main(["import", "--stand", str(stand), str(table), "-o", str(bags)]) == 0
    stamps = [r.stamp_ns for _, r in read_bag(bags / "run", [Scan])]
    assert abs(stamps[0] - round(MOMENT.timestamp() * 1e9)) < 50_000, "a day has 53 bits"
    assert len(stamps) > 0.99 * SCANS
    assert abs(np.median(np.diff(stamps)) - PERIOD_NS) < 1000
