from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("numba") is None, reason="numba is an extra"
)

ESTIMATES = """
import numpy as np
from flea_diag.core.residuals.parameters import ActuatorParameters
from flea_diag.core.observers.state_observer import StateObserver
from flea_diag.configuration.description import compiled_relations

FLEA = compiled_relations("actuator.yaml").residuals
RELATIONS = compiled_relations("actuator.yaml", None, False)
draw = np.random.default_rng(2)
rows = np.zeros((100, len(FLEA.channels)))
rows[:, FLEA.index["motor_current"]] = draw.normal(0.0, 0.5, 100)
rows[:, FLEA.index["motor_voltage"]] = draw.normal(0.0, 3.0, 100)
rows[:, FLEA.index["actuator_position"]] = draw.normal(0.05, 6e-5, 100)
p, generator = ActuatorParameters(**RELATIONS.described), np.random.default_rng(0)
observer = StateObserver(p, RELATIONS, 0.01, generator, 200, "numba")
print(observer.follow(rows).table.tobytes().hex())
"""


def test_what_is_compiled_now_and_what_was_on_disk_give_the_same_bits(tmp_path: Path):
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    command = [sys.executable, "-c", ESTIMATES]
    cold, warm = (
        subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout
        for _ in range(2)
    )
    assert list(tmp_path.rglob("*.nbc"))
    assert len(cold) > 1000
    assert warm == cold
