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

"""Readings that are held, of channels whose noise says nothing."""

from __future__ import annotations

import numpy as np
import pytest

from flea_diag.configuration.calibrations import learned
from flea_diag.configuration.description import compiled_relations
from flea_diag.configuration.stand import load_stand
from flea_diag.core.sensors.held_reading import HeldReadings
from flea_diag.core.sensors.sensor_limits import SensorLimit, sensor_limits

FLEA = compiled_relations("actuator.yaml").residuals.sensors
CHANNELS = ("motor_current", "motor_voltage", "commanded_voltage")
LIMIT = SensorLimit("motor_voltage", 0.0, 0.0, 0.0, 4, 0.0, 0.0, 0.0)
VOLTS = [1.0, 2.0, 2.0, 2.0, 2.0, 3.0, np.nan, np.nan, 3.0, 3.0]
COMMANDS = [1.0, 2.0, 2.5, 2.5, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]


def runs(cuts: list[int]) -> list[float]:
    """Changes of the command under a held voltage, of scans that come in these parts."""
    tested = HeldReadings([LIMIT], CHANNELS, FLEA, 0.01)
    assert [FLEA.names[at] for at in tested.places] == ["motor_voltage_stuck"]
    # 0.5 s of 0.01 s.
    assert tested.k.tolist() == [50.0]
    rows = np.stack((np.zeros(len(VOLTS)), VOLTS, COMMANDS), axis=1)
    parts = np.split(rows, cuts)
    told = [np.full((len(part), len(FLEA.names)), np.nan) for part in parts]
    for part, z in zip(parts, told, strict=True):
        assert not tested.step(part, part.copy(), z)
    return np.concatenate(told)[:, tested.places[0]].tolist()


@pytest.mark.parametrize("cuts", [[], [2, 3], list(range(1, 10))])
def test_changes_of_the_command_are_counted_whatever_the_blocks(cuts: list[int]) -> None:
    assert runs(cuts) == [0, 0, 1, 1, 2, 0, 0, 0, 1, 2]


@pytest.mark.parametrize("cuts", [[], [2, 3], list(range(1, 10))])
@pytest.mark.parametrize("channels", [CHANNELS, CHANNELS[:2]], ids=["missing", "no channel"])
def test_without_a_command_a_held_voltage_blames_nobody_and_is_withheld(
    cuts: list[int], channels: tuple[str, ...]
) -> None:
    """From the fourth repeat on, until it changes."""
    volts = [1.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 3.0, 3.0, np.nan]
    rows = np.stack((np.zeros(len(volts)), volts, np.full(len(volts), np.nan)), axis=1)
    tested, usable = HeldReadings([LIMIT], channels, FLEA, 0.01), rows.copy()
    bounds = zip([0, *cuts], [*cuts, len(rows)], strict=True)
    z = np.zeros((len(rows), len(FLEA.names)))
    withheld = [tested.step(rows[a:b], usable[a:b], z[a:b]) for a, b in bounds]
    assert any(withheld)
    assert not z.any()
    assert np.flatnonzero(np.isnan(usable[:, 1])).tolist() == [5, 6, 9]
    assert np.array_equal(usable[:, 0], rows[:, 0])


@pytest.mark.parametrize("stand", ["flea", "ema", "wing"])
def test_every_machine_that_is_shipped_knows_how_long_its_voltage_may_be_held(stand: str) -> None:
    limits = {limit.channel: limit for limit in learned(load_stand(stand)).sensors}
    assert limits["motor_voltage"].has("motor_voltage_stuck")


def test_a_gap_ends_a_run() -> None:
    tested = HeldReadings([LIMIT], CHANNELS, FLEA, 0.01)
    rows = np.array([[0.0, 2.0, 1.0], [0.0, 2.0, 2.0], [0.0, 2.0, 3.0]])
    for _ in range(2):
        z = np.zeros((len(rows), len(FLEA.names)))
        tested.step(rows, rows.copy(), z)
        assert z[:, tested.places[0]].tolist() == [0, 1, 2]
        tested.interrupt()


def test_a_voltage_that_healthy_recordings_hold_for_seconds_is_not_tested() -> None:
    random = np.random.default_rng(3)
    busy = [{"motor_voltage": random.normal(size=2000)} for _ in range(2)]
    held = [{"motor_voltage": np.repeat(random.normal(size=5), 400)} for _ in range(2)]
    (of_busy,), (of_held,) = (sensor_limits(runs, FLEA, 0.1, 0.01) for runs in (busy, held))
    assert (of_busy.repeats, of_held.repeats) == (2, 0)
    assert of_busy.has("motor_voltage_stuck")
    assert not of_held.has("motor_voltage_stuck")
    assert not of_busy.has("motor_voltage_noise")
    assert HeldReadings([of_held], CHANNELS, FLEA, 0.01).places == []
