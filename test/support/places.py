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

"""Where the project and the real recordings lie."""

from __future__ import annotations

import os
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

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


def script(path: str) -> Any:
    """A module that lies in no package, by its path below the root."""
    spec = spec_from_file_location(Path(path).stem, ROOT / path)
    assert spec is not None
    assert spec.loader is not None
    made = module_from_spec(spec)
    spec.loader.exec_module(made)
    return made
