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

"""The FLEA's own recordings: calibrated on every second nominal run, diagnosed on the others."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pytest
from support import in_turn
from support.places import FLEA

from flea_diag.configuration import calibrations
from flea_diag.configuration import knowledge as of_stand
from flea_diag.configuration.description import compiled_relations
from flea_diag.configuration.stand import load_stand
from flea_diag.core.calibration.calibration import Calibration
from flea_diag.stages.isolator.isolator import IsolatorParameters, IsolatorStage, Knowledge
from flea_diag.stages.observer.observer import ObserverStage
from flea_diag.stages.observer.observer_parameters import ObserverParameters
from flea_diag.stages.pipeline import Pipeline
from flea_diag.tools.calibrate.calibrate import write_calibration
from flea_diag.tools.calibrate.nominal_recording import read_nominal
from flea_diag.tools.calibrate.procedure import calibrate
from flea_diag.tools.evaluate.case_run import in_blocks
from flea_diag.tools.recordings.flea_data import read_flea_data
from flea_diag.tools.recordings.flea_run import FleaRun
from flea_diag.tools.recordings.importer import import_run
from flea_diag.wire.blocks import ScanBlock
from flea_diag.wire.records import AmbiguityGroup, DataQuality, Detection, Outcome, Quality

FILES = sorted(FLEA.glob("*_Low.data"))
NOMINAL = [file for file in FILES if "_Nominal_" in file.name]
LEARNED, FRESH = NOMINAL[::2], NOMINAL[1::2]
OF_KIND = {
    kind: [f for f in FILES if f"_{kind}_" in f.name] for kind in ("Spall", "Jam", "Position")
}
OF_KIND["Nominal"] = FRESH
REPLAYED = {kind: in_turn(files) for kind, files in OF_KIND.items()}
"""Recordings of one kind differ by their motion alone, and go the same way through the code."""

pytestmark = pytest.mark.skipif(
    not FILES, reason=f"needs the FLEA recordings: none in {FLEA}, set FLEA_DATA_DIR"
)

DEFECTIVE = {
    *("sine34", "trap32", "trap34", "trap36", "triang32", "triang34", "triang36"),
    *("sine32", "sweep12", "triang16"),
}
"""Motions of the nominal runs whose voltage channel is bad, all along or in bursts."""


@dataclass(frozen=True)
class Diagnosis:
    outcomes: tuple[Outcome, ...]
    group: frozenset[str]
    episodes: int
    not_observable: frozenset[str]
    bad: frozenset[str]


def motion(file: Path) -> str:
    return file.name.split("_")[1]


STAND = load_stand(features="feature_table_paper.yaml")


@cache
def knowledge(calibration: Path) -> Knowledge:
    learned = calibrations.load_calibration(calibration)
    return of_stand.knowledge(STAND, learned)


def replay(calibration: Path, file: Path) -> Diagnosis:
    known = knowledge(calibration)
    effects = of_stand.effects(STAND, known.calibration)
    observer = ObserverStage(known.calibration, effects, ObserverParameters())
    stages = Pipeline((observer, IsolatorStage(known, IsolatorParameters())))
    recording = FleaRun.of(read_flea_data(file))
    out = list(stages.handle(recording.channel_table()))
    for block in in_blocks(recording.scans()):
        assert isinstance(block, ScanBlock)
        out += [r for r in stages.handle_block(block) if isinstance(r, Said)]
    out += stages.finish()
    groups = [r for r in out if isinstance(r, AmbiguityGroup)]
    quality = [row for r in out if isinstance(r, DataQuality) for row in r.channels]
    return Diagnosis(
        tuple(group.outcome for group in groups),
        frozenset(member.fault for member in groups[-1].members),
        sum(r.detected for r in out if isinstance(r, Detection)),
        frozenset(fault for fault, _ in groups[-1].not_observable),
        frozenset(row.channel for row in quality if row.quality is Quality.BAD),
    )


Said = (AmbiguityGroup, DataQuality, Detection)


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("flea")
    bags = [Path(import_run(file, folder / "bags").bag) for file in LEARNED]
    recordings, refused = read_nominal(bags, compiled_relations("actuator.yaml").residuals)
    assert not refused
    write_calibration(folder / "calibration.yaml", calibrate(recordings, "actuator.yaml", 0.1))
    return folder / "calibration.yaml"


@pytest.fixture(scope="module")
def found(calibrated: Path) -> dict[Path, Diagnosis]:
    return {file: replay(calibrated, file) for files in REPLAYED.values() for file in files}


def of_kind(found: dict[Path, Diagnosis], kind: str, count: int) -> list[tuple[str, Diagnosis]]:
    assert len(OF_KIND[kind]) == count
    return [(file.name, found[file]) for file in REPLAYED[kind]]


def test_the_parameters_are_those_of_the_nominal_unit(calibrated: Path) -> None:
    p = calibrations.load_calibration(calibrated).parameters
    # Regressions over the whole set of runs, made by other means.
    assert p.winding_resistance_ohm == pytest.approx(2.95, abs=0.25)
    assert p.back_emf_v_s_per_m == pytest.approx(176.6, rel=0.04)
    assert p.force_constant_n_per_a == pytest.approx(176.7, rel=0.06)
    assert p.coulomb_friction_n == pytest.approx(47.0, abs=20.0)
    assert p.viscous_friction_n_s_per_m == pytest.approx(412.0, rel=0.4)
    assert 80.0 < p.reflected_mass_kg < 170.0
    assert 0.008 < p.motor_heating_k_per_a2s < 0.014


def test_calibration_finds_the_bad_voltage_by_itself(calibrated: Path) -> None:
    calibration: Calibration = calibrations.load_calibration(calibrated)
    assert {stretch.channel for stretch in calibration.bad_stretches} == {"motor_voltage"}
    found = {stretch.run.split("_")[1] for stretch in calibration.bad_stretches}
    assert found == {motion(file) for file in LEARNED} & DEFECTIVE


def test_no_fault_is_called_on_a_nominal_run(found: dict[Path, Diagnosis]) -> None:
    for name, row in of_kind(found, "Nominal", len(FRESH)):
        assert row.episodes == 0, name
        assert row.outcomes[-1] is Outcome.NOMINAL, name


def test_a_spall_is_not_observable_without_vibration(found: dict[Path, Diagnosis]) -> None:
    for name, row in of_kind(found, "Spall", 8):
        assert row.episodes == 0, name
        assert row.outcomes[-1] is Outcome.NOMINAL, name
        assert "spall" in row.not_observable, name
        # One position sensor and no encoder: its slope is the only speed.
        assert "actuator_position_drift" in row.not_observable, name


def test_every_jam_is_detected_and_isolated(found: dict[Path, Diagnosis]) -> None:
    for name, row in of_kind(found, "Jam", 12):
        assert row.episodes >= 1, name
        assert {"jam"} <= row.group <= {"jam", "ball_nut_friction"}, name


def test_every_position_fault_is_isolated_to_its_sensor(found: dict[Path, Diagnosis]) -> None:
    for name, row in of_kind(found, "Position", 5):
        assert row.episodes >= 1, name
        assert row.group, name
        assert all(fault.startswith("actuator_position_") for fault in row.group), name


def test_bad_voltage_is_named_in_the_runs_that_have_it(found: dict[Path, Diagnosis]) -> None:
    for file, row in found.items():
        if file in FRESH:
            expected = {"motor_voltage"} if motion(file) in DEFECTIVE else set()
            assert row.bad == expected, file.name
        elif "_Position_" in file.name:
            assert row.bad == {"motor_voltage"}, file.name
        elif "_Jam_" in file.name:
            assert row.bad == set(), file.name
