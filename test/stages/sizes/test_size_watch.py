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

"""A short that grows while the stand runs: its size is followed, scan by scan and in blocks."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest
import yaml

from flea_diag.configuration.component import make_pipeline
from flea_diag.configuration.stand import Stand, load_stand
from flea_diag.stages.sizes import size_watch
from flea_diag.tools.evaluate.case_run import in_blocks
from flea_diag.wire.blocks import ScanBlock
from flea_diag.wire.records import NEVER_NS, Record, Scan, SizeTrend, Truth
from flea_sim_driver.scenario.scenario_file import scenario_from_mapping
from flea_sim_driver.stand import SimulatedStand

pytestmark = pytest.mark.slow
ONSET_S, GROWS_S, SHARE, TURN_OHM = 10.0, 220.0, 0.4, 2.95
SECOND_NS = 10**9
END = 2**63
"""After all stamps."""
LIMIT = 0.36
"""Share of the constant at the end of life, as written into the catalogue here."""


@pytest.fixture(scope="module")
def stand(tmp_path_factory: pytest.TempPathFactory) -> Stand:
    """The shipped stand with a limit for what a short loses of the constant."""
    told = load_stand()
    rows = yaml.safe_load(Path(told.faults).read_text(encoding="utf-8"))
    (row,) = (s for e in rows["faults"]["winding_short"]["effects"] for s in e["sizes"]
              if s["name"] == "constant lost")  # fmt: skip
    row["limit"] = LIMIT
    path = tmp_path_factory.mktemp("stand") / "faults.yaml"
    path.write_text(yaml.safe_dump(rows), encoding="utf-8")
    return replace(told, faults=path)


@cache
def sent() -> tuple[Record, ...]:
    motion = {"kind": "sine", "amplitude_m": 0.0218, "frequency_hz": 0.3, "centre_m": 0.045}
    values = {
        "motion": motion, "duration_s": 240.0, "seed": 16, "sensors": {"vibration": False},
        "faults": [{"fault": "winding_short", "onset_s": ONSET_S, "size": SHARE,
                    "growth_s": GROWS_S}],
    }  # fmt: skip
    records = SimulatedStand(scenario_from_mapping(values, "short"))
    return tuple(record for record in records if not isinstance(record, Truth))


def followed(stand: Stand, alone: tuple[int, int] = (END, END)) -> list[SizeTrend]:
    """What is said of the size in blocks; the last scans, of stamps in ``alone``, go singly."""
    begin_ns, end_ns = alone
    before = [record for record in sent() if record.stamp_ns < begin_ns]
    singly = [record for record in sent() if begin_ns <= record.stamp_ns < end_ns]
    pipeline, said = make_pipeline(stand), []
    for record in (*in_blocks(before), *singly):
        by_block = isinstance(record, ScanBlock)
        said += pipeline.handle_block(record) if by_block else pipeline.handle(record)
    return [record for record in said if isinstance(record, SizeTrend)]


@pytest.fixture(scope="module")
def told(stand: Stand) -> list[SizeTrend]:
    """All of it in blocks."""
    return followed(stand)


@pytest.mark.in_turn(2)
def test_its_growth_and_its_end_are_told_while_it_grows(told: list[SizeTrend]) -> None:
    start_ns = next(record.stamp_ns for record in sent() if isinstance(record, Scan))
    end_ns = start_ns + round((ONSET_S + GROWS_S * LIMIT / SHARE) * 1e9)
    assert {(t.fault, t.quantity, t.limit) for t in told} == {
        ("winding_short", "constant lost", LIMIT)
    }
    assert [len(t.sizes) for t in told] == list(range(1, len(told) + 1))
    assert len(told) >= 4
    grown = told[-1]
    assert grown.direction == "grows"
    assert grown.slope_per_s == pytest.approx(SHARE / GROWS_S, abs=3.0 * grown.slope_sigma_per_s)
    ahead = [t for t in told if t.stamp_ns < end_ns and t.median_ns != NEVER_NS]
    assert ahead, "foretold before it is there"
    assert all(t.low_ns <= end_ns for t in ahead)
    assert all(end_ns <= t.high_ns for t in ahead if t.high_ns != NEVER_NS)


@pytest.mark.in_turn(2)
def test_scan_by_scan_it_is_the_same_but_for_the_order_of_sums(
    stand: Stand, told: list[SizeTrend]
) -> None:
    """The last scans before a size, which sums all since the one before."""
    blocks = told[:2]
    end_ns = blocks[1].stamp_ns + SECOND_NS
    alone = followed(stand, (blocks[1].stamp_ns - 4 * SECOND_NS, end_ns))
    assert [t.stamp_ns for t in alone] == [t.stamp_ns for t in blocks]
    for one, other in zip(alone[-1].sizes, blocks[-1].sizes, strict=True):
        assert one.at_ns == other.at_ns
        assert one.size == pytest.approx(other.size, rel=1e-6)
        assert one.sigma == pytest.approx(other.sigma, rel=1e-5)


@pytest.mark.in_turn(2)
def test_many_sizes_become_fewer_that_hold_as_much(
    stand: Stand, told: list[SizeTrend], monkeypatch: pytest.MonkeyPatch
) -> None:
    every = told[-1]
    monkeypatch.setattr(size_watch, "MOST_KEPT", 3)
    fewer = followed(stand)[-1]
    assert len(fewer.sizes) <= 3 < len(every.sizes)
    assert fewer.sizes[0].sigma < every.sizes[0].sigma
    assert 0.0 < fewer.slope_sigma_per_s < 0.5 * SHARE / GROWS_S
    assert fewer.slope_per_s == pytest.approx(SHARE / GROWS_S, abs=3.0 * fewer.slope_sigma_per_s)
