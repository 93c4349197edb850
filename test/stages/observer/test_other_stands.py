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

"""Stands with other sensors than the FLEA's run through calibration and observer."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml
from support import stands
from support.models import stepper

from flea_diag.configuration.description import compiled_relations
from flea_diag.core.calibration.calibration import Calibration, NominalRun
from flea_diag.core.calibration.calibration_reader import from_mapping
from flea_diag.core.likelihood.effect_set import effect_set
from flea_diag.stages.observer.observer import ObserverStage
from flea_diag.stages.observer.observer_parameters import ObserverParameters
from flea_diag.stages.pipeline import Pipeline
from flea_diag.tools.calibrate.nominal_recording import NominalRecording
from flea_diag.tools.calibrate.procedure import calibrate
from flea_diag.wire.records import DataQuality, Detection, Quality, Record, Residual, Scan

RUNS = 6
ONSET_S = 60.0


@pytest.fixture(scope="module")
def described(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("stepper") / "actuator.yaml"
    path.write_text(yaml.safe_dump(stepper.DESCRIPTION, sort_keys=False))
    return path


@pytest.fixture(scope="module")
def learned(described: Path) -> Calibration:
    recordings = [
        NominalRecording(
            NominalRun(f"run{n}", stepper.rows(stepper.run(n))),
            "stepper",
            stepper.CHANNELS,
            "",
            stepper.PERIOD_S,
        )
        for n in range(RUNS)
    ]
    return calibrate(recordings, described, 0.1)


def observed(described: Path, learned: Calibration, columns: stepper.Columns) -> list[Record]:
    relations = compiled_relations(described, learned.channels, has_encoder=False)
    stage = ObserverStage(learned, effect_set(relations, ()), ObserverParameters())
    period_ns = round(stepper.PERIOD_S * 1e9)
    values = stepper.rows(columns).tolist()
    scans = [Scan(k * period_ns, stepper.CHANNELS, tuple(row)) for k, row in enumerate(values)]
    return list(stands.said_in_blocks(Pipeline((stage,)), scans))


def of(kind: type, records: list[Record]) -> list:
    return [record for record in records if isinstance(record, kind)]


def test_the_power_of_a_supply_is_identified(learned):
    p = learned.parameters
    assert p.supply_voltage_v == pytest.approx(stepper.SUPPLY_V, rel=0.01)
    assert p.current_offset_a == pytest.approx(stepper.IDLE_A, abs=0.02)
    # Over few speeds a watt of idling is next to a watt of dry friction: their sum is known best.
    idle = p.supply_voltage_v * (p.current_offset_a - stepper.IDLE_A)
    drawn = idle + (p.coulomb_friction_n + p.viscous_friction_n_s_per_m * 0.03) * 0.03
    assert drawn == pytest.approx((stepper.DRY_N + stepper.VISCOUS * 0.03) * 0.03, rel=0.03)
    assert "no motor_voltage channel" in learned.not_identified["winding_resistance_ohm"]
    assert [limit.name for limit in learned.limits] == ["parity_power"]
    assert from_mapping(yaml.safe_load(yaml.safe_dump(learned.to_mapping())), "x") == learned


@pytest.mark.slow
def test_a_healthy_stepper_is_quiet_and_a_drag_is_detected(described, learned):
    assert not of(Detection, observed(described, learned, stepper.run(7)))
    dragged = observed(described, learned, stepper.run(7, drag_n=75.0, onset_s=ONSET_S))
    detection = of(Detection, dragged)[0]
    # A stroke of 4 s holds 100 scans, the shortest mean of which is 2 s long.
    assert ONSET_S < detection.stamp_ns / 1e9 < ONSET_S + 15.0
    assert detection.residual == "parity_power"


def test_nothing_is_computed_for_what_the_stand_lacks(described, learned):
    records = observed(described, learned, stepper.run(8, seconds=20.0))
    last = of(Residual, records)[-1]
    assert {name.split("_")[0] for name in last.names} <= {"parity", "motor", "actuator"}
    assert np.isfinite(last.values[last.names.index("parity_power")])
    assert last.estimates == ()
    states = {row.channel: row.quality for row in of(DataQuality, records)[-1].channels}
    assert [states[name] for name in stepper.CHANNELS] == [Quality.GOOD] * 3
    assert "motor_voltage" not in states


def test_the_idle_current_of_a_unit_is_learned_at_rest(described, learned):
    """A rest says nothing of friction, and all of what the supply idles with."""
    draw, scans = np.random.default_rng(4), round(10.0 / stepper.PERIOD_S)
    rest = {
        "motor_current": stepper.IDLE_A + 0.01 + 0.01 * draw.standard_normal(scans),
        "actuator_position": 0.1 + 1e-5 * draw.standard_normal(scans),
        "commanded_load": np.full(scans, 200.0),
    }
    (offset,) = of(DataQuality, observed(described, learned, rest))[-1].offsets
    assert offset.parameter == "current_offset_a"
    assert offset.value == pytest.approx(stepper.IDLE_A + 0.01, abs=2.0 * offset.sigma)
    assert offset.sigma < 0.02
