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

"""A recording in a drawn dialect walked through ``flea stand new``, held against the plain one."""

from __future__ import annotations

import contextlib
import io
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import yaml

from flea_diag.configuration.channels import channel_sources
from flea_diag.configuration.stand import load_stand
from flea_diag.tools.main import main
from flea_diag.tools.recordings.mapped_source import mapped_recordings
from support.foreign.bag_dialects import bag_of, drawn_bag, plain_bag
from support.foreign.dialect_verdicts import LOSING, DialectVerdicts, Writer, drawn_motion
from support.foreign.table_dialects import Motion, drawn_dialect, plain, written

KEYS = ("unit", "sign", "scale")


@dataclass(frozen=True)
class Walked:
    """What came of one recording; ``wrong`` says in what it is, "" where it is right."""

    words: str
    status: int
    said: str
    wrong: str


def walked_table(folder: Path, seed: int, verdicts: DialectVerdicts | None = None) -> Walked:
    """Draw a dialect and a motion, write both ways, and hold the stands against each other.

    With ``verdicts`` the motion is longer, half of them have a fault, and what ``flea replay`` says
    is held against each other, too.
    """
    rng = np.random.default_rng(seed)
    dialect = drawn_dialect(rng)
    uneven = dialect.odd == "uneven steps"
    motion = drawn_motion(rng, uneven) if verdicts else Motion.drawn(rng, uneven=uneven)
    folder.mkdir()

    def write(path: Path, motion: Motion) -> Path:
        return written(path, motion, plain(dialect), rng)

    clean, file = write(folder / "clean", motion), written(folder / "run", motion, dialect, rng)
    walked = _walked(folder, clean, file, dialect.words)
    sticks = motion.sticks if dialect.odd in LOSING else None
    return _judged(walked, verdicts, clean, file, write, sticks)


def walked_bag(folder: Path, seed: int, verdicts: DialectVerdicts | None = None) -> Walked:
    """The same with a bag."""
    rng = np.random.default_rng(seed)
    dialect = drawn_bag(rng)
    motion = drawn_motion(rng) if verdicts else Motion.drawn(rng)
    folder.mkdir()

    def write(path: Path, motion: Motion) -> Path:
        return bag_of(path, motion, plain_bag(dialect), rng)

    clean, file = write(folder / "clean", motion), bag_of(folder / "run", motion, dialect, rng)
    walked = _walked(folder, clean, file, dialect.words)
    sticks = motion.sticks if dialect.odd in LOSING else None
    return _judged(walked, verdicts, clean, file, write, sticks)


def _judged(
    walked: Walked, verdicts: DialectVerdicts | None, clean: Path, file: Path, write: Writer,
    sticks: bool | None,
) -> Walked:  # fmt: skip
    """The same, held against the verdict on the plain recording where all else is right."""
    if verdicts is None or walked.wrong or walked.status:
        return walked
    stands = file.parent / "expected", file.parent / "mine"
    return replace(walked, wrong=verdicts.differ(stands[0], clean, stands[1], file, write, sticks))


def _walked(folder: Path, clean: Path, file: Path, words: str) -> Walked:
    expected, _, _ = _new(folder / "expected", clean)
    status, out, errors = _new(folder / "mine", file)
    lines = errors.splitlines()
    if status:
        one = len(lines) == 1 and lines[0].startswith("flea: ") and "Traceback" not in errors
        return Walked(words, status, errors.strip(), "" if one else "no single line")
    if expected:
        return Walked(words, status, out, "the plain table is refused, this is not")
    wrong = _differs(folder / "expected", folder / "mine") or _readings(folder, clean, file)
    return Walked(words, status, out, wrong)


def _new(stand: Path, recording: Path) -> tuple[int, str, str]:
    out, errors = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(errors):
        status = main(["stand", "new", str(stand), "--from", str(recording)])
    return status, out.getvalue(), errors.getvalue()


def _differs(one: Path, other: Path) -> str:
    """In what two stands differ: description, channels, their sources, units and signs."""
    read = [yaml.safe_load((s / "channels.yaml").read_text(encoding="utf-8")) for s in (one, other)]
    rows = [each["channels"] for each in read]
    if rows[0].keys() != rows[1].keys():
        return f"channels {sorted(rows[1])} instead of {sorted(rows[0])}"
    for name, wanted in rows[0].items():
        found = rows[1][name]
        for key in KEYS:
            same = found.get(key) == wanted.get(key)
            near = key == "scale" and np.isclose(
                found.get(key, 1.0), wanted.get(key, 1.0), rtol=0.01
            )
            if not same and not near:
                return f"{name}: {key} {found.get(key)} instead of {wanted.get(key)}"
        places = [row.get("column") or row["field"] for row in (found, wanted)]
        if places[0] != places[1]:
            return f"{name}: {places[0]} instead of {places[1]}"
    if abs(read[0]["rate_hz"] / read[1]["rate_hz"] - 1.0) > 0.05:
        return f"rate {read[1]['rate_hz']} instead of {read[0]['rate_hz']} Hz"
    return ""


def _readings(folder: Path, clean: Path, file: Path) -> str:
    """Whether the scans hold the readings of the plain table."""
    made = []
    for stand, recording in ((folder / "expected", clean), (folder / "mine", file)):
        found = list(mapped_recordings(recording, channel_sources(load_stand(stand.absolute()))))
        if len(found) != 1:
            return f"{len(found)} recordings"
        scans = found[0].scans()
        stamps = np.array([scan.stamp_ns for scan in scans])
        made.append(((stamps - stamps[0]) * 1e-9, np.array([scan.values for scan in scans])))
    (at_s, wanted), (own_s, values) = made
    if len(own_s) < 0.8 * len(at_s):
        return f"{len(own_s)} scans instead of {len(at_s)}"
    for column in range(wanted.shape[1]):
        use, known = np.isfinite(values[:, column]), np.isfinite(wanted[:, column])
        expected = np.interp(own_s[use], at_s[known], wanted[known, column])
        off = np.abs(values[use, column] - expected)
        span = float(np.ptp(wanted[known, column]))
        if float(np.quantile(off, 0.95)) > 0.05 * span:
            return f"readings of column {column} are off by {float(off.max()) / span:.0%}"
        if use.mean() < 0.8:
            return f"{use.mean():.0%} of the readings of column {column}"
    return ""
