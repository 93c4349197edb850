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

"""Short recordings as ten other stands would have made them, all of one motion that we know."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from flea_diag.wire.bags.bag import read_bag
from flea_diag.wire.records import Scan
from support.decisions import BAGS
from support.foreign import arm

Array = npt.NDArray[np.float64]
SCANS = 900
START_NS = 1_600_000_000 * 10**9
PERIOD_NS = 10_000_000

INTO: Mapping[str, Callable[[Array], Array]] = {
    "mm": lambda x: x / 1e-3,
    "in": lambda x: x / 0.0254,
    "rpm": lambda x: x * 30.0 / np.pi,
    "deg/s": lambda x: x * 180.0 / np.pi,
    "mA": lambda x: x / 1e-3,
    "lbf": lambda x: x / 4.4482216152605,
    "kgf": lambda x: x / 9.80665,
    "kN": lambda x: x / 1e3,
    "degF": lambda x: 32.0 + x * 1.8,
    "K": lambda x: x + 273.15,
}
"""Unit -> what a sensor in it would read; written apart from the units of the package."""


@dataclass(frozen=True)
class Sent:
    """How one channel was recorded: name, unit ("" for SI), sign, every which reading."""

    channel: str
    name: str
    unit: str = ""
    sign: float = 1.0
    every: int = 1

    def readings(self) -> Array:
        """What the recorder wrote."""
        values = self.sign * truth(self.channel)
        return INTO[self.unit](values) if self.unit else values


@cache
def known_motion() -> dict[str, Array]:
    """Every channel of the shipped nominal bag in SI, shape (``SCANS``,) each."""
    scans = [r for _, r in read_bag(BAGS / "nominal", (Scan,)) if isinstance(r, Scan)][:SCANS]
    values = np.array([scan.values for scan in scans])
    return {name: values[:, k] for k, name in enumerate(scans[0].channels)}


def truth(channel: str) -> Array:
    """Readings of one channel in SI."""
    return known_motion()[channel]


def csv(path: Path, sent: tuple[Sent, ...], separator: str = ",", every: int = 1) -> Path:
    """A table of text with the time in seconds."""
    time = np.arange(SCANS) * 1e-9 * PERIOD_NS
    table = np.column_stack([time, *(each.readings() for each in sent)])[::every]
    head = separator.join(["time", *(each.name for each in sent)])
    np.savetxt(path, table, delimiter=separator, header=head, comments="", fmt="%.9g")
    return path


def npz(path: Path, sent: tuple[Sent, ...], every: int = 1) -> Path:
    """Arrays with the time in milliseconds."""
    columns = {each.name: each.readings()[::every] for each in sent}
    np.savez(path, t=np.arange(SCANS)[::every] * 1e-6 * PERIOD_NS, **columns)
    return path


def topics(sent: tuple[Sent, ...], slow: int = 0) -> Iterator[tuple[str, int, Any]]:
    """A Float64 topic for each channel; a Temperature for one whose name ends on that.

    ``slow``: from the middle on every so many readings are lost, if not 0.
    """
    rows = [(each, each.readings()) for each in sent]
    for number in range(SCANS):
        if slow and number > SCANS // 2 and number % slow:
            continue
        stamp_ns = START_NS + number * PERIOD_NS
        for each, values in rows:
            if number % each.every == 0:
                yield each.name, stamp_ns, _message(each, float(values[number]), stamp_ns)


def _message(each: Sent, value: float, stamp_ns: int) -> Any:
    if each.name.endswith("temperature"):
        return arm.T[arm.TEMPERATURE](arm.header_at(stamp_ns), value, 0.0)
    return arm.T["std_msgs/msg/Float64"](value)


def joint_states(
    names: list[str], position: Sent, velocity: Sent, effort: Sent, others: tuple[Sent, ...]
) -> Iterator[tuple[str, int, Any]]:
    """A JointState of several joints, of which the last moves, and other topics."""
    moving = [each.readings() for each in (position, velocity, effort)]
    rest = [0.0] * (len(names) - 1)
    for topic, stamp_ns, message in topics((*others, Sent("motor_current", "/states"))):
        if topic != "/states":
            yield topic, stamp_ns, message
            continue
        row = (stamp_ns - START_NS) // PERIOD_NS
        values = [[*rest, float(each[row])] for each in moving]
        yield topic, stamp_ns, arm.joint_state(arm.header_at(stamp_ns), names, *values)
