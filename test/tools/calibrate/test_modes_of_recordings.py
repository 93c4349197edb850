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

"""Modes that recordings of a calibration never show."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flea_diag.configuration.description import compiled_relations
from flea_diag.configuration.stand import load_stand
from flea_diag.core.calibration.calibration import NominalRun
from flea_diag.core.residuals.residual_rows import ResidualSet
from flea_diag.errors import CalibrationError
from flea_diag.tools.calibrate.nominal_recording import NominalRecording
from flea_diag.tools.calibrate.recording_checks import check_bands, check_modes

AXIS = compiled_relations(load_stand("axis").actuator).residuals


def recorded(brake: float, channels: tuple[str, ...] = AXIS.channels) -> NominalRecording:
    rows = np.zeros((10, len(AXIS.channels)))
    rows[:, AXIS.index["brake_engaged"]] = brake if "brake_engaged" in channels else np.nan
    return NominalRecording(NominalRun("one", rows), "axis", channels, "", 0.01)


def only(known: ResidualSet) -> ResidualSet:
    """The same where a relation holds in the mode alone."""
    (mode,) = known.modes
    return replace(known, modes=(replace(mode, voids=(), only=(0,)),))


def test_a_mode_that_one_recording_shows_needs_no_word() -> None:
    assert check_modes([recorded(0.0), recorded(1.0)], AXIS) == []


def test_a_mode_that_none_shows_is_said() -> None:
    (words,) = check_modes([recorded(0.0), recorded(0.2)], AXIS)
    assert words.startswith("mode braked is never seen: brake_engaged is nowhere above 0.5; record")


def test_relations_of_a_mode_that_none_shows_are_refused() -> None:
    said = "brake_engaged is nowhere above 0.5, and parity_mechanical holds in it alone: record"
    with pytest.raises(CalibrationError, match=said):
        check_modes([recorded(0.0)], only(AXIS))


def test_a_mode_whose_channel_none_has_is_refused() -> None:
    without = tuple(name for name in AXIS.channels if name != "brake_engaged")
    with pytest.raises(CalibrationError, match="no recording has the channel brake_engaged"):
        check_modes([recorded(0.0, without)], AXIS)


def test_a_supply_beyond_its_band_is_refused() -> None:
    healthy, low = recorded(0.0), recorded(0.0)
    healthy.run.rows[:, AXIS.index["bus_voltage"]] = 300.0
    check_bands([healthy], AXIS)
    low.run.rows[:, AXIS.index["bus_voltage"]] = 240.0
    with pytest.raises(CalibrationError, match="bus_voltage reads 240 V in the mean, supply link"):
        check_bands([healthy, low], AXIS)
