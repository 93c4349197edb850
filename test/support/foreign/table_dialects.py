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

"""Tables of one motion in a dialect that is drawn: what people export, and what is odd about it."""

from __future__ import annotations

import csv
import datetime as dt
import gzip
import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Rng = np.random.Generator
EPOCH_S = 1_709_632_800.0
DAY = dt.datetime.fromtimestamp(EPOCH_S, tz=dt.timezone.utc)

NAMES: dict[str, tuple[str, str, str, str]] = {
    "snake": ("time", "motor_current", "motor_speed", "actuator_position"),
    "words": ("Time", "Motor Current", "Motor Speed", "Actuator Position"),
    "joint": ("timestamp", "elbow_current", "elbow_velocity", "elbow_position"),
    "robot": ("timestamp", "actual_current_0", "actual_qd_0", "actual_q_0"),
    "German": ("Zeit", "Motorstrom", "Drehzahl", "Winkel"),
    "paths": ("__time", "/drive/current", "/drive/velocity", "/drive/position"),
}
UNITS: dict[str, tuple[tuple[str, float], ...]] = {
    "current": (("A", 1.0), ("mA", 1e3)),
    "speed": (("rad/s", 1.0), ("rpm", 30.0 / np.pi), ("deg/s", 180.0 / np.pi)),
    "position": (("rad", 1.0), ("deg", 180.0 / np.pi)),
}
TIMES: dict[str, Callable[[float], str]] = {
    "s": lambda s: f"{s:.6f}",
    "epoch s": lambda s: f"{EPOCH_S + s:.6f}",
    "epoch ms": lambda s: str(round(1e3 * (EPOCH_S + s))),
    "epoch us": lambda s: str(round(1e6 * (EPOCH_S + s))),
    "epoch ns": lambda s: str(round(EPOCH_S) * 10**9 + round(1e9 * s)),
    "ISO Z": lambda s: (DAY + dt.timedelta(seconds=s)).strftime("%Y-%m-%dT%H:%M:%S.%fZ"),
    "ISO zone": lambda s: (DAY + dt.timedelta(seconds=s)).isoformat(timespec="microseconds"),
    "ISO blank": lambda s: (DAY + dt.timedelta(seconds=s)).strftime("%Y-%m-%d %H:%M:%S.%f"),
    "day first": lambda s: (DAY + dt.timedelta(seconds=s)).strftime("%d.%m.%Y %H:%M:%S.%f"),
    "time of day": lambda s: (DAY + dt.timedelta(seconds=s)).strftime("%H:%M:%S.%f"),
}
ODD = (
    "nothing", "nothing", "a row twice", "two rows swapped", "every row twice", "no number",
    "a cut row", "a gap", "any order", "empty cells", "uneven steps", "a coarse clock",
)  # fmt: skip


@dataclass(frozen=True)
class Motion:
    """Readings in SI of a joint in motion: time, current, speed of the motor, angle."""

    time_s: Array
    current: Array
    speed: Array
    position: Array
    sticks: bool = False
    """Whether its friction rises halfway."""

    @classmethod
    def drawn(
        cls, rng: Rng, rows: int = 500, rate_hz: float = 100.0, uneven: bool = False
    ) -> Motion:
        """A motion both ways, with friction, inertia and the noise of its sensors."""
        steps = rng.choice([0.6, 1.0, 1.4], rows) if uneven else np.ones(rows)
        t = (np.cumsum(steps) - steps[0]) / rate_hz
        phase, a = rng.uniform(0.0, 6.0), rng.uniform(1.0, 2.0)
        q = 2.5 + a * np.sin(1.1 * t + phase) + 0.3 * np.sin(2.7 * t)
        v = 1.1 * a * np.cos(1.1 * t + phase) + 0.81 * np.cos(2.7 * t)
        dv = -1.21 * a * np.sin(1.1 * t + phase) - 2.187 * np.sin(2.7 * t)
        i = 0.8 * np.tanh(v / 0.05) + v + 0.14 * dv + rng.normal(0.0, 0.03, rows)
        speed = 80.0 * v + rng.normal(0.0, 0.3, rows)
        return cls(t, i, speed, q + rng.normal(0.0, 1e-4, rows))


@dataclass(frozen=True)
class Dialect:
    """How a table is written; ``odd`` is what is wrong with it."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    said: str
    time: str
    separator: str = ","
    decimal: str = "."
    encoding: str = "utf-8"
    newline: str = "\n"
    head: str = ""
    quoted: bool = False
    ending: str = ".csv"
    odd: str = "nothing"
    beside: tuple[str, ...] = ()

    @property
    def words(self) -> str:
        """What it is, for people."""
        mark = {"\t": "tab", " ": "blank"}.get(self.separator, self.separator)
        said = self.said or "untold"
        return (
            f"{self.ending} {self.encoding} mark {mark} decimal {self.decimal} time {self.time} "
            f"units {said} beside {'+'.join(self.beside) or 'nothing'} odd: {self.odd}"
        )


@dataclass
class Columns:
    """Names and cells of a table before it is written."""

    names: list[str]
    rows: list[list[str]]
    units: list[str] = field(default_factory=list)


def drawn_dialect(rng: Rng) -> Dialect:
    """One of some hundred thousand dialects."""
    pick: Callable[[Sequence[str]], str] = lambda some: str(rng.choice(list(some)))  # noqa: E731
    style = pick(list(NAMES))
    said = pick(["", "brackets", "parentheses", "ending", "line"])
    if style in ("German", "paths", "robot") and said == "ending":
        said = "brackets"
    units = tuple(
        pick([unit for unit, _ in UNITS[key]]) if said else UNITS[key][0][0] for key in UNITS
    )
    separator = pick([",", ",", ";", "\t", "|", " "])
    decimal = "." if separator in (",", " ") else pick([".", ","])
    time = pick(list(TIMES))
    if separator == " " and time in ("ISO blank", "day first"):
        time = "s"
    head = pick(["", "", "comment", "preamble", "blank lines"])
    ending = pick([".csv", ".csv", ".txt", ".tsv", ".dat", ".csv.gz"])
    beside = tuple(
        b for b in ("counter", "state", "constant", "text", "other joint") if rng.random() < 0.2
    )
    if separator == " ":
        style, said, beside = "snake", "", tuple(b for b in beside if b != "text")
        units = tuple(UNITS[key][0][0] for key in UNITS)
    if style in ("paths", "words", "German", "joint"):
        beside = tuple(b for b in beside if b != "other joint")
    return Dialect(
        NAMES[style], units, said, time, separator, decimal,
        pick(["utf-8", "utf-8", "utf-8-sig", "utf-16", "cp1252"]),
        pick(["\n", "\r\n", "\r"]), head, rng.random() < 0.2 and separator != " ", ending,
        pick(ODD), beside,
    )  # fmt: skip


def plain(dialect: Dialect) -> Dialect:
    """The same names and units in the plainest table."""
    return Dialect(dialect.names, dialect.units, dialect.said, "s", beside=dialect.beside)


def written(path: Path, motion: Motion, dialect: Dialect, rng: Rng) -> Path:
    """A table in a dialect; its path has the ending of its format."""
    table = _columns(motion, dialect)
    _made_odd(table, dialect, rng)
    text = _text(table, dialect)
    data = text.replace("\n", dialect.newline).encode(dialect.encoding)
    path = path.with_name(path.name + dialect.ending)
    path.write_bytes(gzip.compress(data) if dialect.ending.endswith(".gz") else data)
    return path


def _columns(motion: Motion, dialect: Dialect) -> Columns:
    factors = [dict(UNITS[key])[unit] for key, unit in zip(UNITS, dialect.units, strict=True)]
    readings = (motion.current, motion.speed, motion.position)
    columns = [factor * values for factor, values in zip(factors, readings, strict=True)]
    names = [
        _named(n, u, dialect.said) for n, u in zip(dialect.names[1:], dialect.units, strict=True)
    ]
    stamps = motion.time_s
    if dialect.odd == "a coarse clock":
        stamps = np.floor(stamps * 10.0 + 1e-6) / 10.0
    say = TIMES[dialect.time]
    rows = [
        [say(t), *(f"{x:.7g}" for x in row)]
        for t, row in zip(stamps, np.column_stack(columns).tolist(), strict=True)
    ]
    table = Columns([dialect.names[0], *names], rows, ["", *dialect.units])
    for beside in dialect.beside:
        _add(table, beside, dialect, motion)
    return table


def _named(name: str, unit: str, said: str) -> str:
    if said == "brackets":
        return f"{name} [{unit}]"
    if said == "parentheses":
        return f"{name} ({unit})"
    return f"{name}_{unit.replace('/', '_')}" if said == "ending" else name


def _add(table: Columns, beside: str, dialect: Dialect, motion: Motion) -> None:
    """A column that is no channel of this joint."""
    kinds: dict[str, tuple[str, Callable[[int], str]]] = {
        "counter": ("sample", str),
        "state": ("mode", lambda k: str(1 + k // 300)),
        "constant": ("gain", lambda k: "1.5"),
        "text": ("status", lambda k: "run"),
    }
    if beside == "other joint":
        for name, values in zip(dialect.names[1:], (motion.current, motion.speed, motion.position),
                                strict=True):  # fmt: skip
            table.names.append(_named(name.replace("0", "1"), "", ""))
            table.units.append("")
            for row, value in zip(table.rows, 1e-3 * values, strict=True):
                row.append(f"{value:.7g}")
        return
    name, cell = kinds[beside]
    table.names.append(name)
    table.units.append("")
    for k, row in enumerate(table.rows):
        row.append(cell(k))


def _made_odd(table: Columns, dialect: Dialect, rng: Rng) -> None:
    rows, k = table.rows, int(rng.integers(100, len(table.rows) - 100))
    if dialect.odd == "a row twice":
        rows.insert(k, list(rows[k]))
    elif dialect.odd == "two rows swapped":
        rows[k], rows[k + 1] = rows[k + 1], rows[k]
    elif dialect.odd == "every row twice":
        rows[:] = [list(row) for row in rows for _ in (0, 1)]
    elif dialect.odd == "no number":
        rows[k][1] = str(rng.choice(["#N/A", "OVRFLW", "---", "err"]))
    elif dialect.odd == "a cut row":
        del rows[k][2:]
    elif dialect.odd == "a gap":
        del rows[k : k + 90]
    elif dialect.odd == "any order":
        rows[:] = [rows[j] for j in rng.permutation(len(rows))]
    elif dialect.odd == "empty cells" and dialect.separator != " ":
        for j in rng.integers(0, len(rows), 20).tolist():
            rows[j][2] = ""


def _text(table: Columns, dialect: Dialect) -> str:
    moments = dialect.time.startswith(("ISO", "day", "time"))
    stream = io.StringIO()
    start = {"comment": "# rig 3\n# operator N\n", "preamble": "Test rig 3\n\n"}
    stream.write(start.get(dialect.head, ""))
    quoting = csv.QUOTE_ALL if dialect.quoted else csv.QUOTE_MINIMAL
    writer = csv.writer(stream, delimiter=dialect.separator, lineterminator="\n", quoting=quoting)
    writer.writerow(table.names)
    if dialect.said == "line":
        writer.writerow(["" if moments else "s" if dialect.time == "s" else "", *table.units[1:]])
    for row in table.rows:
        cells = [
            c if k == 0 and moments else c.replace(".", dialect.decimal) for k, c in enumerate(row)
        ]
        writer.writerow(cells)
    text = stream.getvalue()
    return text.replace("\n", "\n\n") if dialect.head == "blank lines" else text
