"""Where the project and the real recordings lie."""

from __future__ import annotations

import os
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
CONFIG = ROOT / "config"
FLEA_STAND = CONFIG / "stands" / "flea"
WING = CONFIG / "stands" / "wing" / "actuator.yaml"
"""Description of another machine than the FLEA."""
SHIPPED_STANDS = {
    path.name: path
    for path in sorted((CONFIG / "stands").iterdir())
    if (path / "stand.yaml").exists()
}
DATA = Path(os.environ.get("FLEA_DATA_DIR") or ROOT.parent / "shared" / "data")
"""Real recordings, which are not part of the project: tests on them are skipped without."""
FLEA = DATA / "flea"
