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

"""The verdict on a recording in any dialect, held against that on the plain one."""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import yaml

from flea_diag.tools.main import main
from support.foreign.table_dialects import Motion, Rng

ROWS = 1200
"""Long enough for a verdict on either half."""
STICKS = 0.5
"""Share of the recordings with a fault, from their middle on."""
FRICTION_A = 2.0
"""What that friction takes of current: beyond what so few healthy recordings leave open."""
FRICTIONS = frozenset(("jam", "gear_friction"))
"""What it may be called."""
LOSING = frozenset(("a gap", "lost"))
"""Dialects whose files lack readings: their verdict may come later, or at another motion."""
HEALTHY = 6
"""Recordings of a calibration."""
Writer = Callable[[Path, Motion], Path]
"""Writes a motion as a plain table or bag."""


def drawn_motion(rng: Rng, uneven: bool = False) -> Motion:
    """A healthy motion, or one whose friction rises halfway."""
    motion = Motion.drawn(rng, ROWS, uneven=uneven)
    if rng.random() >= STICKS:
        return motion
    late = np.arange(ROWS) >= ROWS // 2
    current = motion.current + FRICTION_A * np.sign(motion.speed) * late
    return replace(motion, current=current, sticks=True)


@dataclass(frozen=True)
class Said:
    """What a replay says: outcome and members, or why it is refused."""

    words: str
    members: frozenset[str] = frozenset()


class DialectVerdicts:
    """Verdicts by one description and one calibration for all joints of the same readings.

    What a dialect changes is channels.yaml; a description differs by what each motion has shown.

    Parameters
    ----------
    folder
        Where the stands are kept.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._refused: dict[Path, str] = {}
        self.otherwise: list[str] = []
        """Verdicts on files that lack readings that are other ones, and right."""
        self.without: list[str] = []
        """Why there was none: in the unit that was taken it moves too slowly to calibrate by."""

    def differ(
        self, plain: Path, clean: Path, mine: Path, file: Path, write: Writer, sticks: bool | None
    ) -> str:
        """In what the verdict on a file differs from that on the plain one; "": in nothing.

        ``plain`` and ``mine`` are the stands that were made of ``clean`` and ``file``. ``sticks``
        is told of a file that lacks readings: then a group that holds what is true is right, too.
        """
        known = self._calibrated(plain, write)
        if known in self._refused:
            self.without.append(self._refused[known])
            return ""
        wanted, found = (_verdict(known, *each) for each in ((plain, clean), (mine, file)))
        if found.words == wanted.words:
            return ""
        if sticks is not None and found.members >= wanted.members:
            true = bool(found.members & FRICTIONS) if sticks else not found.members
            if true:
                self.otherwise.append(f"{found.words} instead of {wanted.words}")
                return ""
        return f"verdict {found.words} instead of {wanted.words}"

    def _calibrated(self, plain: Path, write: Writer) -> Path:
        """A stand with a calibration whose channels hold the same readings as this one's."""
        known = self._folder / _readings(plain)
        if not known.exists():
            shutil.copytree(plain, known)
            motions = [Motion.drawn(np.random.default_rng(k), ROWS) for k in range(HEALTHY)]
            place = known / "healthy"
            place.mkdir()
            files = [str(write(place / f"run_{k}", motion)) for k, motion in enumerate(motions)]
            output = ["-o", str(known / "calibration.yaml")]
            status, words = _said(["calibrate", *files, "--stand", str(known), *output])
            assert status == 0 or words.startswith("flea: the recordings hold "), words
            if status:
                self._refused[known] = words.strip()
        return known


def _readings(plain: Path) -> str:
    """Which readings a stand has, and in which units they are taken to be; a digest."""
    rows = yaml.safe_load((plain / "channels.yaml").read_text(encoding="utf-8"))["channels"]
    kind = (plain / "actuator.yaml").read_text(encoding="utf-8").splitlines()[0]
    parts = sorted((name, row.get("unit"), row.get("sign")) for name, row in rows.items())
    return hashlib.sha256(repr((kind, parts)).encode()).hexdigest()[:16]


def _verdict(known: Path, stand: Path, recording: Path) -> Said:
    """What is said of a recording with the channels of this stand."""
    shutil.copy(stand / "channels.yaml", known / "channels.yaml")
    status, out = _said(["replay", str(recording), "--stand", str(known), "-q", "--json", "-"])
    if not out.startswith("{"):
        return Said(f"refused ({status}): {out}")
    said = json.loads(out)
    members = sorted(said["ambiguity_group"])
    return Said(" ".join([said["outcome"], *members]), frozenset(members))


def _said(argv: list[str]) -> tuple[int, str]:
    """Exit status, and output, or errors where there is none."""
    out, errors = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(errors):
        status = main(argv)
    return status, out.getvalue() or errors.getvalue()
