"""A simulated link under gravity: what its torque sensor reads at rest, and what a payload adds."""

from __future__ import annotations

import math

import pytest
from support.stand_runs import records, scans

LEVEL, LINK, ARM, GRAVITY = 1.8, 1.9, 0.55, 9.81
"""Of config/machines/shoulder.yaml: rad, kg m, m, m/s^2."""


@pytest.mark.parametrize(("angle", "payload"), [(1.8, 0.0), (0.9, 3.0)])
def test_it_hangs_by_its_moment(angle: float, payload: float) -> None:
    motion = {"kind": "hold", "centre_m": angle}
    run = scans(records(machine="shoulder", motion=motion, load={"payload_kg": payload},
                        unit_spread=0.0, duration_s=3.0))  # fmt: skip
    moment = GRAVITY * (LINK + ARM * payload) * math.cos(angle - LEVEL)
    hoses = 0.5 * (angle - 1.5)
    torque = float(run["load_force"][200:].mean())
    # Friction of the bearing of the arm holds up to 0.4 N m of it, and roughness shakes it.
    assert torque == pytest.approx(moment + hoses, abs=0.6)
