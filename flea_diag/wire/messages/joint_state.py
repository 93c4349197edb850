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

"""Numeric records as sensor_msgs/JointState, in the fields ``name`` and ``position``."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np

from flea_diag.errors import WireError, shown
from flea_diag.wire import records as r
from flea_diag.wire.blocks import ResidualBlock
from flea_diag.wire.messages.cdr import (
    ENCAPSULATION,
    KEPT_BYTES,
    STAMP,
    CdrReader,
    CdrWriter,
    stamp_bytes,
)
from flea_diag.wire.vocabulary import SECOND_NS

Z, THRESHOLD, REGRESSOR = "/z", "/threshold", "regressor/"
ESTIMATE, ESTIMATE_SIGMA = "/estimate", "/estimate_sigma"
HEALTH = ("observer/ess", "observer/nis", "observer/diverged")
"""Suffixes and names that mark the kind of each number on ``residual``."""

KURTOSIS = "/kurtosis"
"""The same for ``vibration_level``; a standard deviation has the plain name of the axis."""

_AFTER_STAMP = len(ENCAPSULATION) + STAMP.size
_NO_VELOCITY_NOR_EFFORT = bytes(8)
Names = tuple[str, ...]


class _Form(NamedTuple):
    """What a stream repeats in every message: all but the stamp and the numbers."""

    names: Names
    between: bytes
    """From the frame to the first number."""
    numbers: struct.Struct
    end: int = 0
    """Of the numbers, in a message that was read."""


_READ: dict[int, _Form] = {}
"""Size of a message -> form of the latest of this size."""
_MOST_READ = 64
MOST_NAMES = 2000
"""Of one message: each takes a row of data quality and its words."""


def encode(record: Any, _: str) -> bytes:
    """CDR bytes of a record of numbers."""
    form_of, values_of = _COLUMNS[type(record)]
    form, values = form_of(record), values_of(record)
    if len(form.names) != len(values):
        kind = type(record).__name__
        raise WireError(f"{kind}: {len(form.names)} names but {len(values)} values")
    numbers, stamp = form.numbers.pack(*values), stamp_bytes(record.stamp_ns)
    return b"".join((ENCAPSULATION, stamp, form.between, numbers, _NO_VELOCITY_NOR_EFFORT))


def encode_residuals(block: ResidualBlock) -> Iterator[bytes]:
    """CDR bytes of each record of a block, the very same as of the record by itself."""
    form = _form_of(
        block.names, block.regressor_names, block.estimated, HEALTH if block.health.size else ()
    )
    last, estimated = 3 * len(block.names), 3 * len(block.names) + len(block.regressor_names)
    end = estimated + 2 * len(block.estimated)
    table = np.empty((len(block), len(form.names)), dtype="<f8")
    table[:, 0:last:3], table[:, 1:last:3] = block.values, block.z
    table[:, 2:last:3], table[:, last:estimated] = block.thresholds, block.regressors
    table[:, estimated:end:2], table[:, estimated + 1 : end : 2] = (
        block.estimates, block.estimate_sigmas,
    )  # fmt: skip
    table[:, end:] = block.health
    for stamp_ns, row in zip(block.stamps_ns.tolist(), table, strict=True):
        stamp, numbers = stamp_bytes(stamp_ns), row.tobytes()
        yield b"".join((ENCAPSULATION, stamp, form.between, numbers, _NO_VELOCITY_NOR_EFFORT))


@lru_cache(maxsize=64)
def _form(names: Names) -> _Form:
    writer = CdrWriter(0)
    writer.u32(len(names))
    for name in names:
        writer.text(name)
    writer.u32(len(names))
    if names:
        writer.align(8)
    return _Form(names, bytes(writer)[_AFTER_STAMP:], struct.Struct(f"<{len(names)}d"))


def decode(record_type: type, reader: CdrReader) -> Any:
    """Read a record of numbers; velocity and effort are skipped."""
    stamp_ns = reader.stamp_ns()
    names = reader.texts()
    if len(names) > MOST_NAMES:
        raise WireError(
            f"{len(names)} names, at most {MOST_NAMES}: send those of one stand", "size"
        )
    values, end = _floats(reader), reader.place
    skipped = _floats(reader), _floats(reader)
    reader.end()
    if len(names) != len(values):
        raise WireError(f"{len(names)} names but {len(values)} positions")
    if not any(skipped):
        _remember(reader, names, end)
    return _RECORD[record_type](stamp_ns, names, values)


def _remember(reader: CdrReader, names: Names, end: int) -> None:
    numbers = struct.Struct(f"<{len(names)}d")
    between = reader.part(_AFTER_STAMP, end - numbers.size)
    if len(between) > KEPT_BYTES:
        return
    if len(_READ) >= _MOST_READ:
        _READ.clear()
    _READ[reader.size] = _Form(names, between, numbers, end)


def repeated(record_type: type, data: bytes) -> Any:
    """Record of a message that differs in stamp and numbers alone from one read before, or None.

    Nothing else of it needs to be read again, and the names are the very same object.
    """
    form = _READ.get(len(data))
    if form is None or not data.startswith(form.between, _AFTER_STAMP):
        return None
    seconds, nanoseconds = STAMP.unpack_from(data, len(ENCAPSULATION))
    sound = data.startswith(ENCAPSULATION[:2]) and nanoseconds < SECOND_NS
    if not sound or not data.startswith(_NO_VELOCITY_NOR_EFFORT, form.end):
        return None
    values = form.numbers.unpack_from(data, form.end - form.numbers.size)
    return _RECORD[record_type](seconds * SECOND_NS + nanoseconds, form.names, values)


def _floats(reader: CdrReader) -> tuple[float, ...]:
    count = reader.count(8)
    if count:
        reader.align(8)
    return struct.unpack(f"<{count}d", reader.take(8 * count))


def _check_residual(record: r.Residual) -> None:
    names = len(record.names)
    if not names == len(record.values) == len(record.z) == len(record.thresholds):
        raise WireError(
            f"Residual: {names} names but {len(record.values)} values, "
            f"{len(record.z)} z and {len(record.thresholds)} thresholds"
        )
    if len(record.health) not in (0, len(HEALTH)):
        raise WireError(f"Residual: health has {len(record.health)} numbers, must be {len(HEALTH)}")
    estimated = len(record.estimated)
    if not estimated == len(record.estimates) == len(record.estimate_sigmas):
        raise WireError(
            f"Residual: {estimated} estimated channels but {len(record.estimates)} "
            f"estimates and {len(record.estimate_sigmas)} sigmas"
        )


def _residual_form(record: r.Residual) -> _Form:
    _check_residual(record)
    health = HEALTH if record.health else ()
    return _form_of(record.names, record.regressor_names, record.estimated, health)


@lru_cache(maxsize=64)
def _form_of(*names: Names) -> _Form:
    return _form(_layout(*names))


def _layout(
    names: tuple[str, ...],
    regressor_names: tuple[str, ...],
    estimated: tuple[str, ...],
    health: tuple[str, ...],
) -> tuple[str, ...]:
    wrong = next((n for n in (*names, *regressor_names, *estimated) if "/" in n), None)
    if wrong is not None:
        raise WireError(f"Residual: name {shown(wrong)} contains a '/', which is reserved")
    residuals = (name + part for name in names for part in ("", Z, THRESHOLD))
    regressors = (REGRESSOR + name for name in regressor_names)
    estimates = (name + part for name in estimated for part in (ESTIMATE, ESTIMATE_SIGMA))
    return (*residuals, *regressors, *estimates, *health)


def _residual_values(record: r.Residual) -> list[float]:
    last = 3 * len(record.values)
    values = [0.0] * last
    values[0::3], values[1::3], values[2::3] = record.values, record.z, record.thresholds
    values += record.regressors
    for pair in zip(record.estimates, record.estimate_sigmas, strict=True):
        values += pair
    values += record.health
    return values


@lru_cache(maxsize=64)
def _parts(names: tuple[str, ...]) -> tuple[tuple[int, int, int], Names, Names, Names]:
    """End positions and names of residuals, regressors and estimates.

    Raises
    ------
    WireError
        The names are not those of a Residual.
    """
    health = len(names) - (len(HEALTH) if names[-len(HEALTH) :] == HEALTH else 0)
    end = next((k for k, name in enumerate(names) if name.startswith(REGRESSOR)), None)
    estimates = [k for k, name in enumerate(names[:health]) if name.endswith(ESTIMATE)]
    first = estimates[0] if estimates else health
    regressors = first if end is None else end
    names_of = (
        names[:regressors:3],
        tuple(name[len(REGRESSOR) :] for name in names[regressors:first]),
        tuple(name[: -len(ESTIMATE)] for name in names[first:health:2]),
    )
    if _layout(*names_of, names[health:]) != names:
        raise WireError("names are not residuals, each with /z and /threshold")
    return (regressors, first, health), *names_of


def _residual(stamp_ns: int, names: tuple[str, ...], values: tuple[float, ...]) -> r.Residual:
    (end, first, health), residuals, regressors, estimated = _parts(names)
    record = r.Residual(
        stamp_ns,
        residuals,
        values[0:end:3],
        values[1:end:3],
        values[2:end:3],
        regressors,
        values[end:first],
        estimated,
        values[first:health:2],
        values[first + 1 : health : 2],
        values[health:],
    )
    _check_residual(record)
    return record


def _level_form(record: r.VibrationLevel) -> _Form:
    if len(record.kurtosis) not in (0, len(record.axes)):
        raise WireError(
            f"VibrationLevel: {len(record.axes)} axes but a kurtosis of {len(record.kurtosis)}"
        )
    return _form(_axes(record.axes, bool(record.kurtosis)))


@lru_cache(maxsize=64)
def _axes(axes: tuple[str, ...], with_kurtosis: bool) -> tuple[str, ...]:
    wrong = next((axis for axis in axes if axis.endswith(KURTOSIS)), None)
    if wrong is not None:
        raise WireError(f"VibrationLevel: axis {shown(wrong)} has the reserved suffix {KURTOSIS!r}")
    return (*axes, *(axis + KURTOSIS for axis in axes if with_kurtosis))


def _level_values(record: r.VibrationLevel) -> tuple[float, ...]:
    return (*record.std, *record.kurtosis)


def _level(stamp_ns: int, names: tuple[str, ...], values: tuple[float, ...]) -> r.VibrationLevel:
    axes = tuple(name for name in names if not name.endswith(KURTOSIS))
    if _axes(axes, len(axes) < len(names)) != names:
        raise WireError(f"names are not axes, all or none with the suffix {KURTOSIS}")
    return r.VibrationLevel(stamp_ns, axes, values[: len(axes)], values[len(axes) :])


_COLUMNS: dict[type, tuple[Callable[[Any], _Form], Callable[[Any], Sequence[float]]]] = {
    r.Scan: (lambda scan: _form(tuple(scan.channels)), attrgetter("values")),
    r.Residual: (_residual_form, _residual_values),
    r.VibrationLevel: (_level_form, _level_values),
    r.VerdictNumbers: (lambda told: _form(tuple(told.names)), attrgetter("values")),
}
"""Record type -> functions that give the form, with ``name``, and ``position``."""

_RECORD: dict[type, Callable[[int, tuple[str, ...], tuple[float, ...]], Any]] = {
    r.Scan: r.Scan,
    r.Residual: _residual,
    r.VibrationLevel: _level,
    r.VerdictNumbers: r.VerdictNumbers,
}
"""Record type -> function that builds it from stamp, ``name`` and ``position``."""
