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

"""Recordings of the FLEA and of simulated stands, imported, read and calibrated for the law."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from flea_diag.configuration.calibrations import learned
from flea_diag.configuration.description import compiled_relations
from flea_diag.configuration.stand import load_stand
from flea_diag.tools.calibrate.law import LawDesign
from flea_diag.tools.calibrate.nominal_recording import NominalRecording, read_any, read_nominal
from flea_diag.tools.calibrate.procedure import calibrate
from flea_diag.tools.recordings.importer import import_run


def imported(folder: Path, kind: str) -> list[Path]:
    """Bags of the recordings of the FLEA of this kind, below FLEA_DATA_DIR."""
    files = sorted(Path(os.environ.get("FLEA_DATA_DIR", "../shared/data"), "flea").glob("*.data"))
    chosen = [file for file in files if kind in file.name]
    if not chosen:
        raise SystemExit("no recordings: name their folder by FLEA_DATA_DIR")
    for file in chosen:
        import_run(file, folder)
    return sorted(folder.iterdir())


def read_faulty(bags: Sequence[Path], stand: str = "") -> list[NominalRecording]:
    """Recordings whatever their truth."""
    known = compiled_relations(load_stand(stand).actuator).residuals
    return [read_any(bag, known) for bag in bags]


def calibrated_on(bags: Sequence[Path], stand: str = "") -> Any:
    """Recordings, and a calibration without a law from them."""
    place = load_stand(stand)
    recordings, _ = read_nominal(list(bags), compiled_relations(place.actuator).residuals)
    return recordings, calibrate(recordings, place.actuator, 0.1)


def design_of(
    calibration: Any, recordings: Sequence[NominalRecording], stand: str = ""
) -> LawDesign:
    """Columns of a calibration, of its stand's catalogue, and of where recordings have moved."""
    place = load_stand(stand)
    return LawDesign.of(calibration, str(place.actuator), str(place.faults), recordings)


def kinds(recordings: Sequence[NominalRecording]) -> dict[str, list[NominalRecording]]:
    """The FLEA's recordings by the label in their names."""
    labels = ("Nominal", "Jam", "Spall", "Position")
    return {label: [r for r in recordings if f"_{label}" in r.run.name] for label in labels}


def shipped(stand: str = "", calibration: Path | None = None) -> Any:
    """The calibration that a stand is shipped with, or another one."""
    place = load_stand(stand)
    return learned(replace(place, calibration=calibration) if calibration else place)
