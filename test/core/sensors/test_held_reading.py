"""Readings that are held, of channels whose noise says nothing."""

from __future__ import annotations

import numpy as np
import pytest

from flea_diag.core.sensors.held_reading import HeldReadings
from flea_diag.core.sensors.sensor_limits import SensorLimit, sensor_limits

CHANNELS = ("motor_current", "motor_voltage")
LIMIT = SensorLimit("motor_voltage", 0.0, 0.0, 0.0, 4, 0.0, 0.0, 0.0)
VOLTS = [1.0, 2.0, 2.0, 2.0, 3.0, np.nan, np.nan, 3.0, 3.0]


def runs(cuts: list[int]) -> list[float]:
    """Equal readings before each scan, which come in these parts; the current never changes."""
    tested = HeldReadings([LIMIT], CHANNELS, ["other", "motor_voltage_stuck"], 0.01)
    assert tested.places == [1]
    # 0.5 s of 0.01 s.
    assert tested.k.tolist() == [50.0]
    rows = np.stack((np.zeros(len(VOLTS)), VOLTS), axis=1)
    return [x for part in np.split(rows, cuts) for x in tested.step(part)[:, 0].tolist()]


@pytest.mark.parametrize("cuts", [[], [2, 3], list(range(1, 9))])
def test_equal_readings_are_counted_whatever_the_blocks(cuts: list[int]) -> None:
    assert runs(cuts) == [0, 0, 1, 2, 0, 0, 0, 0, 1]


def test_a_gap_ends_a_run() -> None:
    tested = HeldReadings([LIMIT], CHANNELS, ["motor_voltage_stuck"], 0.01)
    rows = np.full((3, 2), 2.0)
    assert tested.step(rows)[:, 0].tolist() == [0, 1, 2]
    tested.interrupt()
    assert tested.step(rows)[:, 0].tolist() == [0, 1, 2]


def test_a_voltage_that_healthy_recordings_hold_for_seconds_is_not_tested() -> None:
    random = np.random.default_rng(3)
    busy = [{"motor_voltage": random.normal(size=2000)} for _ in range(2)]
    held = [{"motor_voltage": np.repeat(random.normal(size=5), 400)} for _ in range(2)]
    (of_busy,), (of_held,) = (sensor_limits(runs, 0.1, 0.01) for runs in (busy, held))
    assert of_busy.repeats == 4 and of_busy.has("motor_voltage_stuck")
    assert of_held.repeats == 0 and not of_held.has("motor_voltage_stuck")
    assert not of_busy.has("motor_voltage_noise")
    assert HeldReadings([of_held], CHANNELS, ["motor_voltage_stuck"], 0.01).places == []
