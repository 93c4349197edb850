"""What one worker of a test run has made, the others read."""

from __future__ import annotations

import fcntl
import hashlib
import os
from collections.abc import Callable
from pathlib import Path

from flea_diag.configuration.calibrations import load_calibration
from flea_diag.core.calibration.calibration import Calibration
from flea_diag.tools.calibrate.calibrate import write_calibration


def shared_calibration(name: str, make: Callable[[], Calibration]) -> Calibration:
    """The calibration of this name, made once a run of the tests: ten seconds of a processor."""
    folder = Path(os.environ["FLEA_CACHE_DIR"]).parent / "calibrations"
    folder.mkdir(exist_ok=True)
    target = folder / f"{hashlib.sha256(name.encode()).hexdigest()}.yaml"
    with target.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not target.exists():
            write_calibration(target, make())
        return load_calibration(target)
