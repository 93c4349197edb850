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

"""Likelihood ratios on bags: a jam, a dead or wrong sensor, and a unit without a fault."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from support.decisions import BAGS

from flea_diag.configuration.stand import load_stand
from flea_diag.stages import Stage
from flea_diag.tools.evaluate.baselines import Setting, baseline
from flea_diag.tools.evaluate.case_run import diagnose
from flea_diag.wire.bags.bag import BagReader
from flea_diag.wire.records import AmbiguityGroup, Record, Scan, Truth

NOMINAL = (BAGS / "nominal",) * 2
"""Healthy running of one unit, which is all that these runs need."""


def stage() -> Stage:
    return baseline("likelihood_ratio").make(Setting(load_stand(), NOMINAL))


@cache
def records(bag: Path) -> tuple[Record, ...]:
    kept = (Scan, Truth)
    return tuple(record for _, record in BagReader(bag).records(kept))


def final(given: tuple[Record, ...]) -> AmbiguityGroup:
    """The last verdict."""
    done = diagnose(given, stage())
    return [record for record in done.kept if isinstance(record, AmbiguityGroup)][-1]


def with_error(channel: str, gain: float, offset: float, from_s: float) -> tuple[Record, ...]:
    """The nominal bag, one channel wrong from some time on."""
    scans = records(BAGS / "nominal")
    start_ns = next(r.stamp_ns for r in scans if isinstance(r, Scan))
    made: list[Record] = []
    for record in scans:
        if isinstance(record, Scan) and record.stamp_ns - start_ns >= from_s * 1e9:
            values = np.array(record.values)
            k = record.channels.index(channel)
            values[k] = gain * values[k] + offset
            record = replace(record, values=tuple(values.tolist()))
        made.append(record)
    return tuple(made)


def test_a_healthy_run_is_nominal() -> None:
    verdict = final(records(BAGS / "nominal"))
    assert (verdict.outcome, verdict.members) == ("NOMINAL", ())


def test_a_jam_is_found_after_its_onset() -> None:
    given = records(BAGS / "jam")
    onset_ns = next(r.onset_ns for r in given if isinstance(r, Truth) and r.fault == "jam")
    verdict = final(given)
    assert "jam" in [member.fault for member in verdict.members]
    assert 0.0 < (verdict.detected_stamp_ns - onset_ns) / 1e9 < 3.0


@pytest.mark.parametrize(
    ("channel", "gain", "offset", "fault"),
    [
        ("motor_current", 1.0, 0.8, "motor_current_bias"),
        ("motor_current", 1.4, 0.0, "motor_current_scaling"),
        ("motor_temperature", 0.0, 30.0, "motor_temperature_dead"),
    ],
)
def test_a_wrong_sensor_is_named(channel: str, gain: float, offset: float, fault: str) -> None:
    verdict = final(with_error(channel, gain, offset, from_s=6.0))
    assert [member.fault for member in verdict.members] == [fault]
