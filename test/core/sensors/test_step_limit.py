"""The limit of steps where a scan is long: a start looks like a step of the sensor."""

from __future__ import annotations

import numpy as np
import pytest

from flea_diag.core.sensors.position_step import position_steps
from flea_diag.core.sensors.sensor_limits import REACH_GUARD, STEP_GUARD, sensor_limits


def strokes(period_s: float, kick_m: float) -> np.ndarray:
    """Strokes at 24 mm/s with rests, each with a kick within a scan halfway."""
    time_s = np.arange(0.0, 60.0, period_s)
    phase = time_s % 13.0
    way = np.clip(phase, 0.0, 5.0) - np.clip(phase - 6.5, 0.0, 5.0)
    kicked = np.where((phase > 2.5) & (phase < 9.0), kick_m, 0.0)
    return np.asarray(0.02 + 0.024 * way + kicked)


@pytest.mark.parametrize(("period_s", "slow"), [(0.04, True), (0.005, False)])
def test_a_step_is_no_shorter_than_the_way_of_a_scan_where_starts_look_like_one(
    period_s: float, slow: bool
) -> None:
    columns = [strokes(period_s, kick_m) for kick_m in ((2.0e-3, 1.8e-3) if slow else (0.0, 0.0))]
    (limit,) = sensor_limits([{"actuator_position": c} for c in columns], 0.1, period_s)
    way = max(float(np.quantile(np.abs(np.diff(c)), 0.999)) for c in columns)
    sudden = max(float(np.abs(position_steps(c)).max()) for c in columns)
    assert (sudden > 0.5 * way) == slow
    assert limit.step == pytest.approx(REACH_GUARD * way if slow else STEP_GUARD * sudden)
