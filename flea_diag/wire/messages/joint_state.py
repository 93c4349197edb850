"""Numeric records as sensor_msgs/JointState, in the fields ``name`` and ``position``."""

from __future__ import annotations

import struct
from collections.abc import Callable
from functools import lru_cache
from itertools import chain
from operator import attrgetter
from typing import Any

from flea_diag.errors import WireError, shown
from flea_diag.wire import records as r
from flea_diag.wire.messages.cdr import ENCAPSULATION, CdrReader, CdrWriter, stamp_bytes

Z, THRESHOLD, REGRESSOR = "/z", "/threshold", "regressor/"
ESTIMATE, ESTIMATE_SIGMA = "/estimate", "/estimate_sigma"
HEALTH = ("observer/ess", "observer/nis", "observer/diverged")
"""Suffixes and names that mark the kind of each number on ``residual``."""

KURTOSIS = "/kurtosis"
"""The same for ``vibration_level``; a standard deviation has the plain name of the axis."""

_STAMP_BYTES = 8
Names = tuple[str, ...]


def encode(record: Any, _: str) -> bytes:
    """CDR bytes of a Scan, Residual or VibrationLevel."""
    if isinstance(record, r.Residual):
        _check_residual(record)
    names, values = _COLUMNS[type(record)]
    return _joint_state(record.stamp_ns, names(record), values(record), type(record).__name__)


def _joint_state(
    stamp_ns: int, names: tuple[str, ...], values: tuple[float, ...], kind: str
) -> bytes:
    if len(names) != len(values):
        raise WireError(f"{kind}: {len(names)} names but {len(values)} values")
    positions = struct.pack(f"<{len(values)}d", *values)
    no_velocity_nor_effort = bytes(8)
    section = _names_section(tuple(names))
    return b"".join(
        (ENCAPSULATION, stamp_bytes(stamp_ns), section, positions, no_velocity_nor_effort)
    )


@lru_cache(maxsize=64)
def _names_section(names: tuple[str, ...]) -> bytes:
    """Bytes from the frame to the first position: the same in every message of a stream."""
    writer = CdrWriter(0)
    writer.u32(len(names))
    for name in names:
        writer.text(name)
    writer.u32(len(names))
    if names:
        writer.align(8)
    return bytes(writer)[len(ENCAPSULATION) + _STAMP_BYTES :]


def decode(record_type: type, reader: CdrReader) -> Any:
    """Read a Scan, Residual or VibrationLevel; velocity and effort are skipped."""
    stamp_ns = reader.stamp_ns()
    names = reader.texts()
    values, _, _ = _floats(reader), _floats(reader), _floats(reader)
    reader.end()
    if len(names) != len(values):
        raise WireError(f"{len(names)} names but {len(values)} positions")
    return _RECORD[record_type](stamp_ns, names, values)


def _floats(reader: CdrReader) -> tuple[float, ...]:
    count = reader.count(8)
    if count:
        reader.align(8)
    return struct.unpack(f"<{count}d", reader.take(8 * count))


def _check_residual(record: r.Residual) -> None:
    wrong = next(
        (n for n in (*record.names, *record.regressor_names, *record.estimated) if "/" in n), None
    )
    if wrong is not None:
        raise WireError(f"Residual: name {shown(wrong)} contains a '/', which is reserved")
    lengths = {len(column) for column in (record.names, record.values, record.z, record.thresholds)}
    if len(lengths) > 1:
        raise WireError(
            f"Residual: {len(record.names)} names but {len(record.values)} values, "
            f"{len(record.z)} z and {len(record.thresholds)} thresholds"
        )
    if len(record.health) not in (0, len(HEALTH)):
        raise WireError(f"Residual: health has {len(record.health)} numbers, must be {len(HEALTH)}")
    lengths = {
        len(column) for column in (record.estimated, record.estimates, record.estimate_sigmas)
    }
    if len(lengths) > 1:
        raise WireError(
            f"Residual: {len(record.estimated)} estimated channels but {len(record.estimates)} "
            f"estimates and {len(record.estimate_sigmas)} sigmas"
        )


def _residual_names(record: r.Residual) -> tuple[str, ...]:
    health = HEALTH if record.health else ()
    return _layout(record.names, record.regressor_names, record.estimated, health)


@lru_cache(maxsize=64)
def _layout(
    names: tuple[str, ...],
    regressor_names: tuple[str, ...],
    estimated: tuple[str, ...],
    health: tuple[str, ...],
) -> tuple[str, ...]:
    residuals = (name + part for name in names for part in ("", Z, THRESHOLD))
    regressors = (REGRESSOR + name for name in regressor_names)
    estimates = (name + part for name in estimated for part in (ESTIMATE, ESTIMATE_SIGMA))
    return (*residuals, *regressors, *estimates, *health)


def _residual_values(record: r.Residual) -> tuple[float, ...]:
    columns = zip(record.values, record.z, record.thresholds, strict=True)
    estimates = zip(record.estimates, record.estimate_sigmas, strict=True)
    return (
        *chain.from_iterable(columns),
        *record.regressors,
        *chain.from_iterable(estimates),
        *record.health,
    )


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


def _level_names(record: r.VibrationLevel) -> tuple[str, ...]:
    if len(record.kurtosis) not in (0, len(record.axes)):
        raise WireError(
            f"VibrationLevel: {len(record.axes)} axes but a kurtosis of {len(record.kurtosis)}"
        )
    return _axes(record.axes, bool(record.kurtosis))


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


_COLUMNS: dict[type, tuple[Callable[[Any], tuple[str, ...]], Callable[[Any], tuple[float, ...]]]]
_COLUMNS = {
    r.Scan: (attrgetter("channels"), attrgetter("values")),
    r.Residual: (_residual_names, _residual_values),
    r.VibrationLevel: (_level_names, _level_values),
}
"""Record type -> functions that give ``name`` and ``position``."""

_RECORD: dict[type, Callable[[int, tuple[str, ...], tuple[float, ...]], Any]] = {
    r.Scan: r.Scan,
    r.Residual: _residual,
    r.VibrationLevel: _level,
}
"""Record type -> function that builds it from stamp, ``name`` and ``position``."""
