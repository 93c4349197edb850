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

"""An installation prefix whose launchers run the sources: what ``ros2 run`` would find."""

from __future__ import annotations

import sys
from pathlib import Path

from support.places import ROOT

PROGRAM = ROOT / "test" / "support" / "programs" / "launch_stand_in.py"


def source_prefix(folder: Path) -> str:
    """Make a prefix below ``folder``; the value of AMENT_PREFIX_PATH by which it is found."""
    marker = folder / "share" / "ament_index" / "resource_index" / "packages" / "flea_diag"
    marker.parent.mkdir(parents=True)
    marker.touch()
    executables = folder / "lib" / "flea_diag"
    executables.mkdir(parents=True)
    for launcher in (ROOT / "launcher").iterdir():
        (executables / launcher.name).symlink_to(launcher)
    python = folder / "bin" / "python3"
    python.parent.mkdir()
    python.write_text(f'#!/bin/sh\nexec {sys.executable} "$@"\n', encoding="utf-8")
    python.chmod(0o755)
    return f"{folder}:{sys.prefix}"


def launched(file: str, *arguments: str) -> list[str]:
    """Command line that launches one of our files, as ``ros2 launch flea_diag FILE`` does."""
    return [sys.executable, str(PROGRAM), str(ROOT / "launch" / file), *arguments]
