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

"""A pause of any length: the observer goes on at once, and says that scans are lost."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support import stands
from support.observer_scans import decisions, healthy

from flea_diag.stages.observer.residual_stream import ResidualStream
from flea_diag.stages.stream.stream_order import AHEAD_NS
from flea_diag.wire.records import Residual

pytestmark = pytest.mark.slow
HOUR_NS = 3_600_000_000_000


@pytest.mark.parametrize("away_ns", [30 * HOUR_NS // 3600, HOUR_NS, 12 * HOUR_NS])
def test_no_more_lost_scans_are_taken_than_are_known(
    away_ns: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those of twelve hours took two minutes, in which nothing was judged."""
    taken, follow = [], ResidualStream._follow

    def counted(stream, stamps_ns, *rows, **more):
        taken.append(len(stamps_ns))
        if taken[-1] > AHEAD_NS // stands.PERIOD_NS:
            pytest.fail(f"{taken[-1]} scans at once")
        return follow(stream, stamps_ns, *rows, **more)

    monkeypatch.setattr(ResidualStream, "_follow", counted)
    begin, end = healthy()[:1000], healthy()[1000:]
    later = [replace(scan, stamp_ns=scan.stamp_ns + away_ns) for scan in end]
    said = stands.replay(stands.observer(), [stands.table(), *begin, *later])
    assert decisions(said) == []
    assert max(taken) == min(away_ns, AHEAD_NS) // stands.PERIOD_NS
    residuals = [record for record in said if isinstance(record, Residual)]
    assert residuals[-1].stamp_ns == later[-1].stamp_ns
    assert np.isfinite(residuals[-1].values).any()
